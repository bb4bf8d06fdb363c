"""The structure of a CAD mesh: parts, contacts, symmetry, planar facets."""

from kpred.shapes.structure.structure import Structure as Structure
