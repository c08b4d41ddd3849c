"""Meshes of two-dimensional tumours at rest: disks, quarter disks, a glioma, any outline, segmented images, and Gmsh files."""

from __future__ import annotations

from tumour.meshes.body import Body, Quality, check
from tumour.meshes.disks import disk, quarter_disk
from tumour.meshes.gmsh import from_gmsh
from tumour.meshes.images import outlines_of_image
from tumour.meshes.outlines import glioma, glioma_outline, inscribed, outline

__all__ = [
    "Body",
    "Quality",
    "check",
    "disk",
    "from_gmsh",
    "glioma",
    "glioma_outline",
    "inscribed",
    "outline",
    "outlines_of_image",
    "quarter_disk",
]
