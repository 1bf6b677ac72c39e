"""Landmarks as plain values: where they are, what they look like, and from where they were seen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...values import F32, F64, I32
from .camera import PinholeCamera

OTHER_ROWS = ("poses", "pixel_sd", "agreement_px", "view_of", "view_px")  # not one a landmark


@dataclass(frozen=True, slots=True, eq=False)
class CameraFit:
    """What was fitted of the camera, and how well: what it stated was used where it stated something."""

    camera: PinholeCamera
    sd: F64  # (3,) standard deviations of the log of the focal length, the tilt and the distortion
    focal_known: bool  # the focal length was stated
    focal_assumed: bool = False  # nothing stated it, and no lens fitted: a usual one was taken

    @property
    def focal_text(self) -> str:
        """The focal length, and where it comes from: "96.2 px (fitted, 95.8 to 96.6)"."""
        low, high = self.focal_interval_px
        fitted = f"fitted, {low:.1f} to {high:.1f}"
        how = "stated" if self.focal_known else "assumed" if self.focal_assumed else fitted
        return f"{self.camera.focal_px:.1f} px ({how})"

    @property
    def focal_interval_px(self) -> tuple[float, float]:
        """The focal length's 95 % interval."""
        half = 1.96 * float(self.sd[0])
        return self.camera.focal_px * float(np.exp(-half)), self.camera.focal_px * float(np.exp(half))


@dataclass(frozen=True, slots=True, eq=False)
class LandmarkSet:
    """M landmarks in the map's frame."""

    fit: CameraFit
    points: F64  # (M, 3) x_m, y_m, and the height above the camera's own plus what was stated for it
    descriptors: F32  # (M, 128) means over the references that saw it, of length one
    sd_m: F32  # (M, 2) of where it is: across the mean line of sight, and along it
    seen: I32  # (M,) references in which it was found
    could_see: I32  # (M,) references in which it could have been
    facing_rad: F32  # (M,) mean direction in the plane from it to the references that saw it
    spread_rad: F32  # (M,) largest angle from that of any of them
    nearest_m: F32  # (M,) least and
    farthest_m: F32  # (M,) largest distance it was seen from
    poses: F64  # (L, 3) of the references, as adjusted
    pixel_sd: float  # of a reprojection along one axis
    agreement_px: F64  # (3,) median, 75 % and 90 % of the reprojection errors in the references
    view_of: I32  # (O, 2) numbers of a reference and of a landmark that was seen in it
    view_px: F32  # (O, 2) where

    @property
    def size(self) -> int:
        """The number of landmarks M."""
        return len(self.points)

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """Return everything as arrays, for a file; descriptors are half as long there."""
        camera = self.fit.camera
        arrays = {field.name: getattr(self, field.name) for field in fields(self) if field.name != "fit"}
        arrays["descriptors"] = self.descriptors.astype(np.float16)
        arrays["pixel_sd"] = np.array(self.pixel_sd)
        arrays["camera"] = np.array([getattr(camera, field.name) for field in fields(camera)], np.float64)
        arrays["camera_sd"] = self.fit.sd
        arrays["focal_known"] = np.array(self.fit.focal_known)
        arrays["focal_assumed"] = np.array(self.fit.focal_assumed)
        return arrays

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> LandmarkSet:
        """Return the landmarks of `to_arrays`. ValueError names what is missing or does not fit."""
        names = [field.name for field in fields(cls) if field.name != "fit"]
        expected = [*names, "camera", "camera_sd", "focal_known", "focal_assumed"]
        missing = [name for name in expected if name not in arrays]
        if missing:
            raise ValueError(f"found landmarks without {missing[0]!r}, expected it; build the library again")
        width, height, *others = (float(v) for v in arrays["camera"])
        camera = PinholeCamera(int(width), int(height), *others)
        focal = bool(arrays["focal_known"]), bool(arrays["focal_assumed"])
        fit = CameraFit(camera, np.asarray(arrays["camera_sd"], np.float64), *focal)
        values: dict[str, Any] = {name: np.asarray(arrays[name]) for name in names}
        values["descriptors"] = values["descriptors"].astype(np.float32)
        values["pixel_sd"] = float(values["pixel_sd"])
        rows = {name: len(values[name]) for name in names if name not in OTHER_ROWS}
        odd = [name for name, count in rows.items() if count != rows["points"]]
        if odd:
            odd_rows = f"{rows[odd[0]]} rows of {odd[0]!r}"
            raise ValueError(f"found {odd_rows}, expected {rows['points']}; build the library again")
        return cls(fit, **values)
