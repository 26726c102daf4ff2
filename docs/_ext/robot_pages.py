"""The gallery: the page of every packaged robot, as `symgen show ROBOT --html` writes it, and a picture
of its skeleton, into robots/ of the site.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from reference import regrouped
from sphinx.application import Sphinx

import symgen
from symgen.derive.loops import close
from symgen.description import packaged_robots
from symgen.description.robot import FIXED, PRISMATIC
from symgen.pages.page import figure, robot_page
from symgen.regroup.regrouping import Regrouping

WIDTH, HEIGHT, MARGIN = 300, 220, 22
BENT = 0.5  # rad, of every joint that may: a straight arm hides its axes


def write_pages(app: Sphinx, failure: Exception | None) -> None:
    if failure is None and app.builder.name == "html":
        folder = Path(app.outdir) / "robots"
        folder.mkdir(exist_ok=True)
        for name in packaged_robots():
            (folder / f"{name}.html").write_text(robot_page(regrouped(name)), encoding="utf-8")
            (folder / f"{name}.svg").write_text(picture(regrouped(name)), encoding="utf-8")


def picture(regrouping: Regrouping) -> str:
    """The skeleton as SVG, seen from above and aside: links, then the axis of each joint that moves
    (orange where it turns, blue where it slides).
    """
    robot = regrouping.robot
    drawn = figure(robot, close(robot))
    bent = 0.0 if robot.loops else BENT
    q = np.array([min(x["start"] + bent, x["high"]) for x in drawn["joints"]])
    T = np.asarray(symgen.model(robot).frame_poses(q))
    g = np.array(drawn["gravity"])
    up = -g / np.linalg.norm(g) if g.any() else np.array([0.0, 0.0, 1.0])
    flat = np.abs(T[:, :3, 2] @ T[0, :3, 2]).min() > 1 - 1e-9 and abs(T[0, :3, 2] @ up) < 0.5
    aside = (
        -T[0, :3, 2]
        if flat
        else np.cross(up, [0.8, -0.6, 0.0] if abs(up[0]) < 0.9 else [0, 0.8, 0.6])
    )
    toward = aside / np.linalg.norm(aside) - 0.4 * up
    toward = toward / np.linalg.norm(toward)
    right = np.cross(toward, up)
    right = right / np.linalg.norm(right)
    view = np.stack([right, np.cross(right, toward)])
    links, axes = [], []
    for frame, pose in zip(robot.frames, T, strict=True):
        origin, z = pose[:3, 3], pose[:3, 2]
        before = T[frame.ant - 1, :3, 3] if frame.ant else np.zeros(3)
        corner = origin - z * (z @ (origin - before))
        links += [(before, corner), (corner, origin)]
        if frame.sigma != FIXED:
            axes.append((origin, z, "#0b7db8" if frame.sigma == PRISMATIC else "#d95f02"))
    points = np.array([view @ x for link in links for x in link])
    low, high = points.min(axis=0), points.max(axis=0)
    scale = min(np.array([WIDTH, HEIGHT]) - 2 * MARGIN) / max(*(high - low), 1e-9)
    half = 9 / scale  # of an axis: 9 points

    def at(x: np.ndarray) -> tuple[float, float]:
        u, v = scale * (view @ x - (low + high) / 2)
        return round(WIDTH / 2 + u, 1), round(HEIGHT / 2 - v, 1)

    def line(a: np.ndarray, b: np.ndarray, style: str) -> str:
        (x1, y1), (x2, y2) = at(a), at(b)
        return f'<line x1="{x1}" y1="{y1}" x2="{x2}" y2="{y2}" {style}/>'

    body = [line(a, b, 'stroke="#667" stroke-width="4"') for a, b in links]
    body += [
        line(o - half * z, o + half * z, f'stroke="{colour}" stroke-width="8"')
        for o, z, colour in axes
    ]
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" '
        f'stroke-linecap="round"><title>{robot.name}</title>{"".join(body)}</svg>'
    )


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("build-finished", write_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
