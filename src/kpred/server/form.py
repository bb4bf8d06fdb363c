"""The form of a request: the scan and its options, each with one line for the OpenAPI page."""

from __future__ import annotations

import re
from pathlib import PurePosixPath
from typing import Annotated, Any, Literal

from fastapi import UploadFile
from pydantic import BaseModel, ConfigDict, Field, Json

from kpred.exports.format_table import check_extension
from kpred.refinement.config import Deform
from kpred.shapes.unit_name import UnitName

MAX_NAME = 150
"""Bytes of the name of a result."""

Settings = Json[dict[str, bool | int | float]]


class FitForm(BaseModel):
    """Fields of `POST /fit`; all but the scan may be left out. They are those of `kpred fit`."""

    model_config = ConfigDict(extra="forbid")

    scan: Annotated[UploadFile, Field(description="Point cloud or mesh of one object; its name says the format")]
    answer: Annotated[
        Literal["files", "mesh", "record"],
        Field(
            description="files: a ZIP of mesh, record and what else is requested; mesh: that file alone; record: JSON"
        ),
    ] = "files"
    format: Annotated[str, Field(description="Extension of the mesh, as .glb .obj .usdz .urdf")] = ".glb"
    name: Annotated[str, Field(description="Stem of the names of files")] = "result"
    picture: Annotated[bool, Field(description="Add a picture (.png); the answer must be files")] = False
    report: Annotated[bool, Field(description="Add a page (report.html); the answer must be files")] = False
    category: Annotated[str | None, Field(description="chair, table, cabinet, ...; else found")] = None
    up: Annotated[Literal["auto", "x", "y", "z", "-x", "-y", "-z"], Field(description="Up axis of the scan")] = "auto"
    unit: Annotated[UnitName | Literal["auto"], Field(description="Unit of the scan's lengths")] = "auto"
    frame: Annotated[Literal["auto", "known"], Field(description="known: y up, front +z, in the unit box")] = "auto"
    pose: Annotated[Literal["identity", "upright"] | None, Field(description="How the object stands; else found")] = (
        None
    )
    partial: Annotated[Literal["auto", "yes", "no"], Field(description="Whether parts are missing")] = "auto"
    deform: Annotated[Deform, Field(description="How far a model may be changed")] = "auto"
    top_k: Annotated[int, Field(ge=1, le=1000, description="Models to deform and compare")] = 10
    model_id: Annotated[str | None, Field(description="Fit this model of the database")] = None
    floor: Annotated[float | None, Field(allow_inf_nan=False, description="Height of the floor, scan's frame")] = None
    sensor: Annotated[str | None, Field(description="Where the scanner stood: x y z, scan's frame")] = None
    clean: Annotated[bool, Field(description="Clean the scan first")] = True
    cleaning: Annotated[Settings | None, Field(description="Settings of cleaning, JSON")] = None
    structure: Annotated[Settings | None, Field(description="Settings of --deform auto and structure, JSON")] = None
    refinement: Annotated[Settings | None, Field(description="Settings of --deform free, JSON")] = None
    density: Annotated[float, Field(gt=0, allow_inf_nan=False, description="kg per cubic metre, for simulations")] = (
        600.0
    )

    @property
    def mesh_name(self) -> str:
        """Name of the mesh file.

        Raises:
            ValueError: the name is no plain file name.
            OutputError: the format is unknown, or its library is not installed.
        """
        plain = PurePosixPath(self.name).name == self.name and "\\" not in self.name and self.name.isprintable()
        if not plain or self.name.startswith(".") or len(self.name.encode()) > MAX_NAME or self.name == "report":
            raise ValueError("name: it must be a plain, short file name without folders.")
        suffix = self.format if self.format.startswith(".") else f".{self.format}"
        if not re.fullmatch(r"\.[A-Za-z0-9]+", suffix):
            raise ValueError("format: it must be an extension, as .glb.")
        check_extension(f"result{suffix}")
        return f"{self.name}{suffix}"

    @property
    def shown(self) -> str:
        """What messages call the scan: the last part of its name, on any system."""
        name = re.split(r"[/\\]", self.scan.filename or "")[-1]
        return "".join(one if one.isprintable() else "_" for one in name)[:200] or "scan"

    @property
    def scan_name(self) -> str:
        """Name under which the scan is kept: of the upload's name only a plain extension is left."""
        suffix = PurePosixPath(self.shown).suffix
        return f"scan{suffix}" if re.fullmatch(r"\.[A-Za-z0-9]{1,8}", suffix) else "scan"

    def options(self) -> dict[str, Any]:
        """Return the options as plain values of `kpred.fit`.

        Raises:
            ValueError: the sensor is no place.
        """
        return {
            "category": self.category,
            "top_k": self.top_k,
            "frame": self.frame,
            "deform": self.deform,
            "model_id": self.model_id,
            "up": self.up,
            "partial": {"auto": None, "yes": True, "no": False}[self.partial],
            "pose": self.pose,
            "sensor": None if self.sensor is None else _place(self.sensor),
            "floor": self.floor,
            "clean": self.clean if self.cleaning is None else self.cleaning,
            "refinement": self.refinement,
            "structure": self.structure,
            "unit": self.unit,
        }


def _place(text: str) -> list[float]:
    try:
        found = [float(word) for word in text.replace(",", " ").split()]
    except ValueError:
        found = []
    if len(found) != 3:
        raise ValueError("sensor: it must be three numbers, x y z.")
    return found
