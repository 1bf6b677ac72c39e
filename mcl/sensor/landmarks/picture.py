"""What people are shown of one picture: matches that agree and that do not, and where landmarks should be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...values import F32, F64, U8, Beside, Bool, PoseProposal, Shown, ShownMarks
from .camera import project
from .landmark_set import LandmarkSet
from .things import moved_things

AGREES_PX = 4.0  # a match nearer than this to where it should be agrees
FARTHEST_PX = 60.0  # lines longer than this to where a landmark should be are not drawn
PICTURE = "Camera: green landmarks agree with the estimate, red do not; white: where the truth has them"
BESIDE = "Camera beside the reference that saw most of these landmarks: green agree, red do not"
SPACE = "space"
MOST_LINES = 60
SIGHT_M = 0.25  # length of the line that shows where the camera looks


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """The matches of one picture, and what they say of poses."""

    landmarks: LandmarkSet
    image: U8 | None  # (H, W, 3)
    pixels: F32  # (K, 2)
    matched: NDArray[np.intp]  # (K,) numbers of landmarks
    chance: F32  # (K,) of being right, before anything is known of the pose
    nats: Mapping[str, float]  # by the name of a pose
    proposal: PoseProposal | None
    thing: NDArray[np.integer[Any]]  # (K,) number of the obstacle that each matched landmark is on, else -1
    names: Sequence[str]  # of the obstacles

    def errors_at(self, pose: F64) -> tuple[F32, F32]:
        """Return where matched landmarks fall for a pose (3,): pixels (K, 2), and how far off (K,)."""
        points = (self.landmarks.points[self.matched] - [pose[0], pose[1], 0.0]).astype(np.float32)
        projected, _ = project(self.landmarks.fit.camera, np.array([[0.0, 0.0, pose[2]]], np.float32), points)
        fallen = np.ascontiguousarray(projected[:, 0].T)
        return fallen, np.hypot(*(fallen - self.pixels).T).astype(np.float32)

    def shown(self, poses: Mapping[str, F64]) -> Shown:
        """Return what to show, judged by the estimate."""
        estimate = poses["estimate"]
        fallen, off = self.errors_at(estimate)
        agrees = off < AGREES_PX
        near = (off < FARTHEST_PX) & self._inside(fallen)
        lines = np.stack([self.pixels[near], fallen[near]], axis=1)
        marks = [ShownMarks("to where the estimate has them", PICTURE, lines, agrees[near])]
        if "truth" in poses:
            true, away = self.errors_at(poses["truth"])
            true = true[(away < FARTHEST_PX) & self._inside(true)][:, None, :]
            marks.append(ShownMarks("where the truth has them", PICTURE, true, of="truth"))
        marks.append(ShownMarks("matched keypoints", PICTURE, self.pixels[:, None, :], agrees))
        places = self.landmarks.points[self.matched][:, None]
        marks.append(ShownMarks("matched landmarks", "map", places[..., :2], agrees))
        marks += self._in_space(places, agrees, estimate)
        pictures: dict[str, U8 | Beside] = {} if self.image is None else {PICTURE: self.image}
        beside = self._beside(agrees)
        if beside is not None:
            pictures[BESIDE] = beside[0]
            marks += beside[1:]
        wrong = self.matched[~agrees]
        camera = self.landmarks.fit.camera
        points, chance = self.landmarks.points[wrong], self.chance[~agrees]
        moved = moved_things(camera, points, self.pixels[~agrees], chance, estimate)
        words, lengths = self._words(agrees, off, estimate)
        return Shown(words, pictures, tuple(marks), lengths, moved)

    def _inside(self, pixels: F32) -> Bool:
        camera = self.landmarks.fit.camera
        last = np.array([camera.width_px - 1, camera.height_px - 1], np.float32)
        return np.asarray(((pixels >= 0) & (pixels <= last)).all(axis=1))

    def _beside(self, agrees: Bool) -> tuple[Beside, ShownMarks, ShownMarks] | None:
        """Put the picture beside that of the reference that saw most agreeing landmarks, else most of all."""
        view_of = self.landmarks.view_of
        if self.image is None:
            return None
        match = np.full(self.landmarks.size, -1)
        match[self.matched] = np.arange(len(self.matched))
        views = np.flatnonzero(match[view_of[:, 1]] >= 0)
        if not len(views):
            return None
        of_match = match[view_of[views, 1]]
        number = int(np.bincount(view_of[views, 0], 1e-3 + agrees[of_match]).argmax())
        same = view_of[views, 0] == number
        views, of_match = views[same], of_match[same]
        order = np.argsort(~agrees[of_match], kind="stable")[:MOST_LINES]
        views, of_match = views[order], of_match[order]
        beside = Beside(self.image, number)
        right = self.landmarks.view_px[views] + np.array([beside.right_px, 0], np.float32)
        lines = np.stack([self.pixels[of_match], right], axis=1)
        ends = lines.reshape(-1, 1, 2)
        judged = agrees[of_match]
        return (
            beside,
            ShownMarks("to the reference", BESIDE, lines, judged),
            ShownMarks("in both", BESIDE, ends, np.repeat(judged, 2)),
        )

    def _in_space(self, places: F64, agrees: Bool, pose: F64) -> list[ShownMarks]:
        """Return landmarks in space, lines of sight to those that agree, and where the camera looks."""
        camera = self.landmarks.fit.camera
        eye = np.array([pose[0], pose[1], camera.height_m])
        heading = pose[2] + camera.yaw_rad
        flat, up = np.cos(camera.tilt_rad), np.sin(camera.tilt_rad)
        ahead = np.array([flat * np.cos(heading), flat * np.sin(heading), up])
        sight = np.stack([eye, eye + SIGHT_M * ahead])[None]
        seen = places[agrees, 0]
        lines = np.stack([np.broadcast_to(eye, seen.shape), seen], axis=1)
        return [
            ShownMarks("matched landmarks", SPACE, places, agrees),
            ShownMarks("lines of sight", SPACE, lines, np.ones(len(lines), np.bool_)),
            ShownMarks("camera", SPACE, sight, of="estimate"),
        ]

    def _words(self, agrees: Bool, off: F32, estimate: F64) -> tuple[str, tuple[float, ...]]:
        count, total = int(agrees.sum()), len(agrees)
        words = f"{count} of {total} matched landmarks agree with the estimate"
        words += f", {np.median(off[agrees]):.1f} px off in the median" if count else ""
        usual = " (in a picture with little to see most matches are wrong)"
        words += f"{usual}." if self.proposal is not None and 2 * count < total else "."
        likelihoods = [f"{nats:z.1f} nats at the {name}" for name, nats in self.nats.items()]
        words += f" Log-likelihood: {', '.join(likelihoods)} (0 if all agreed)." if likelihoods else ""
        if self.proposal is None:
            return f"{words} By themselves they do not tell where the robot is.", ()
        number = int(self.proposal.weights.argmax())
        best, alone = self.proposal.poses[number], self.proposal.from_one_object
        turned = abs(float(np.degrees(np.angle(np.exp(1j * (best[2] - estimate[2]))))))
        distance_m = float(np.hypot(*(best[:2] - estimate[:2])))
        others = len(self.proposal.poses) - 1
        also = f", or at one of {others} other places" if others else ""
        words += f" By themselves they put the robot {{}} and {turned:.1f} deg from the estimate{also}."
        if alone is not None and alone[number]:
            words += f" Only {self._thing_at(best)} says so, and it may have been moved."
        return words, (distance_m,)

    def _thing_at(self, pose: F64) -> str:
        """Name the obstacle with the most landmarks that agree with a pose (3,)."""
        _, off = self.errors_at(pose)
        things = self.thing[(off < AGREES_PX) & (self.thing >= 0)]
        name = self.names[int(np.bincount(things).argmax())] if len(things) else ""
        return f"the {name}" if name else "one obstacle"
