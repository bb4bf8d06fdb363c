"""What a mesh file holds beside positions: materials, textures, UVs, normals, names."""
