"""Text of points as single programs write it: the same cloud comes back from each."""

import json
import warnings

import numpy as np
import pytest

from kpred.errors import ScanError
from kpred.shapes.scan import read_scan

CLOUD = (np.random.default_rng(5).normal(size=(128, 3)) * [0.4, 0.6, 0.3] + [0.3, -0.2, 1.5]).round(4)


def rows(separator: str = " ", before: str = "", after: str = "", number: str = "{:.4f}") -> str:
    """Lines of the cloud; `{}` in what stands before and after them is the number of the line."""
    lines = []
    for place, row in enumerate(CLOUD.tolist()):
        words = [before.format(place)] if before else []
        words += [number.format(value) for value in row] + ([after.format(place)] if after else [])
        lines.append(separator.join(words))
    return "\n".join(lines) + "\n"


def named(names: str, separator: str = ",", before: str = "", after: str = "") -> str:
    return f"{names}\n{rows(separator, before, after)}"


def thousands(value: float) -> str:
    return f"{value + 5155487:,.4f}".translate(str.maketrans(",.", ".,"))


def vectors(left: str, right: str) -> str:
    return "".join(f"{left}{x:.4f}, {y:.4f}, {z:.4f}{right}\n" for x, y, z in CLOUD.tolist())


FILES: dict[str, str] = {
    "CloudCompare.asc": named("//X Y Z R G B Nx Ny Nz", " ", after="1 2 3 0.1 0.2 0.9"),
    "CloudCompare with its count.txt": named(f"//X,Y,Z,Scalar field\n{len(CLOUD)}", after="0.5"),
    "Open3D.xyzn": rows(after="0.1 0.2 0.9", number="{:.10f}"),
    "Open3D.xyzrgb": rows(after="0.1 0.2 0.9", number="{:.10f}"),
    "Leica.pts": f"{len(CLOUD)}\n" + rows(after="-1204 10 20 30"),
    "FARO.xyz": named("Row,Column,X,Y,Z,R,G,B", before="{},7", after="10,20,30"),
    "pandas.csv": named(",x,y,z", before="{}"),
    "pandas with labels.csv": named("idx,x,y,z,label", before="{}", after="chair"),
    "pandas printed.txt": named("            x         y         z", "  ", before="{}"),
    "pandas without values.csv": named("x,y,z,i", after="1") + ",,,1\n,,,\n",
    "R table.txt": named('"x" "y" "z"', " ", before='"{}"'),
    "R with NA.csv": named('"","x","y","z"', before='"{}"') + '"301",NA,NA,NA\n',
    "R without names.csv": named("V1,V2,V3"),
    "MATLAB table.csv": named("Var1,Var2,Var3"),
    "MATLAB pointCloud.csv": named("Location_1,Location_2,Location_3,Color_1,Color_2,Color_3", after="1,2,3"),
    "MATLAB ascii.txt": rows("  ", before=" ", number="{: .8e}"),
    "Octave.txt": "# Created by Octave 8.4.0\n# name: P\n# type: matrix\n# rows: 128\n# columns: 3\n" + rows(),
    "numpy savetxt.txt": "# x y z\n" + rows(number="{:.18e}"),
    "numpy printed.txt": "["
    + "\n ".join("[" + " ".join(f"{value: .4f}" for value in row) + "]" for row in CLOUD.tolist())
    + "]\n",
    "JSON rows.txt": "[\n" + ",\n".join("  " + json.dumps(row) for row in CLOUD.tolist()) + "\n]\n",
    "Grasshopper.txt": vectors("{", "}"),
    "Blender.txt": vectors("<Vector (", ")>"),
    "Unity.txt": vectors("Vector3(", ")"),
    "rostopic.csv": named("%time,field.header.frame_id,field.point.x,field.point.y,field.point.z", before="{},map"),
    "VeloView.csv": named(
        '"intensity","laser_id","timestamp","Points_m_XYZ:0","Points_m_XYZ:1","Points_m_XYZ:2"', before="12,3,{}"
    ),
    "ParaView.csv": named(
        '"Normals_0","Normals_1","Normals_2","Points_0","Points_1","Points_2","Points_Magnitude"',
        before="0.1,0.2,0.9",
        after="2.2",
    ),
    "ArcGIS.txt": named("OBJECTID,POINT_X,POINT_Y,POINT_Z", before="{}"),
    "QGIS.csv": named("fid,xcoord,ycoord,zcoord", before="{}"),
    "Xpos.csv": named("time,Xpos,Ypos,Zpos", before="{}.5"),
    "velocities.csv": named("t;posx;posy;posz;velx;vely;velz", ";", before="{}.5", after="0.1;0.2;0.3"),
    "Ouster.csv": named("TIMESTAMP (ns), RANGE (mm), X1 (mm), Y1 (mm), Z1 (mm)", ", ", before="1{}, 2000"),
    "Livox.csv": named(
        "Version,Slot ID,Error Code,Timestamp,X,Y,Z,Reflectivity,Ori_x,Ori_y,Ori_z",
        before="5,1,0x00000000,{}00",
        after="12,1,2,3",
    ),
    "COLMAP points3D.txt": "# 3D point list with one line of data per point:\n"
    "#   POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n"
    + rows(before="7{}", after="1 2 3 0.8 1 {} 2 4"),
    "XMol.xyz": f"{len(CLOUD)}\npoints of a chair\n" + rows(before="C"),
    "Excel in German.csv": ("sep=;\nx;y;z\n" + rows(";")).replace(".", ","),
    "units below.csv": "x,y,z\nm,m,m\n" + rows(","),
    "PDAL.csv": named('"X","Y","Z","Intensity"', after="1.00"),
    "GOM Inspect.csv": named("# Element;X;Y;Z", ";", before="Point {}"),
    "PolyWorks.txt": named("# polyworks txt: x y z i j k", " ", after="0 0 1"),
    "a sentence of names.txt": named("# columns: x y z intensity", " ", after="7"),
    "a sentence.txt": named("# the x and the y and the z of each point", " "),
    "Houdini.csv": named("P[x],P[y],P[z]"),
    "subscripts.csv": named("time,position[0],position[1],position[2]", before="{}"),
    "AutoCAD.csv": named("Count,Name,Position X,Position Y,Position Z", before="1,Point"),
    "Fortran.txt": rows(number="{:22.12e}").replace("e", "D"),
    "signs.txt": rows(number="{:+.4f}"),
    "markdown.txt": "| x | y | z |\n|---|---|---|\n" + rows(" | ", before=" ", after=" "),
    "TRIMBLE.tsv": named("X\tY\tZ\tRed\tGreen\tBlue", "\t", after="1\t2\t3"),
    "GNU Octave.dat": rows(),
    "RIEGL.asc": named("X[m],Y[m],Z[m],Reflectance[dB]", after="-3.2"),
    "words for nothing.csv": named("x,y,z") + "-,-,-\nN/A,N/A,N/A\n#N/A,#N/A,#N/A\nnull,null,null\n1.0,,2.0\n",
    "no-break spaces.txt": rows("\u00a0"),
    "minus signs.txt": rows().replace("-", "\u2212"),
    "odometry.csv": named("timestamp, frame, x, y, z, qx, qy, qz, qw", ", ", before="0.1, {}", after="0, 0, 0, 1"),
    "two triples.csv": named("sensor_x,sensor_y,sensor_z,lidar_x,lidar_y,lidar_z", before="1,2,3"),
    "Spanish.csv": named("Punto;Este;Norte;Cota", ";", before="P{}"),
    "end of file of DOS.xyz": rows() + "\x1a",
}


@pytest.mark.parametrize("name", FILES)
def test_clouds_of_programs(tmp_path, name):
    (tmp_path / name).write_text(FILES[name], encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        np.testing.assert_allclose(read_scan(tmp_path / name), CLOUD, atol=1e-9)


def test_marks_of_thousands(tmp_path):
    text = "x;y;z\n" + "".join(";".join(map(thousands, row)) + "\n" for row in CLOUD.tolist())
    (tmp_path / "a.csv").write_text(text)
    np.testing.assert_allclose(read_scan(tmp_path / "a.csv"), CLOUD + 5155487, atol=1e-6)


@pytest.mark.parametrize(
    "names",
    [
        "nx,ny,nz,red",
        "sensor_x,sensor_y,sensor_z,i",
        "a_x,a_y,a_z,b",
        "lidar_x,lidar_y,lidar_z,radar_x,radar_y,radar_z",
    ],
)
def test_names_that_are_no_positions_or_not_of_one_thing_are_refused(tmp_path, names):
    (tmp_path / "a.csv").write_text(named(names, after=",".join("1" * (names.count(",") - 2))))
    with pytest.raises(ScanError, match="its columns are named"):
        read_scan(tmp_path / "a.csv")
