"""Robot files of large trees, for measurements and tests: chains, humanoids, arms with hands.

    parse_robot(TREES["humanoid"](30), file="humanoid30.yaml")

Every tree has as many moving joints as asked for, axes at right angles in turn, its own lengths,
and viscous and Coulomb friction at every joint. The shapes are

    chain     one chain
    humanoid  two legs, a trunk of a tenth of the joints, and two arms and a head on the trunk
    hands     a lift, on it two arms, a quarter of the joints; all others in five fingers per arm

so a chain of n joints has n**2/2 blocks in its regressor, and hands of n joints some 10 n.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence


def tree(name: str, ants: Sequence[int], *, prismatic: Sequence[int] = ()) -> bytes:
    """Robot file of the joints 1 .. n, joint j on the frame ants[j - 1]."""
    frames, constants = [], ["g: 9.81"]
    for j, ant in enumerate(ants, start=1):
        length = f"L{j}"
        constants.append(f"{length}: {0.2 + 0.01 * j:.2f}")
        d, r = (length, "0") if j % 2 else ("0", length)
        theta = f"q{j}"
        if j in prismatic:
            theta, r = "0", f"q{j}"
        frames.append(
            f"  {j}: {{ant: {ant}, sigma: {int(j in prismatic)}, "
            f"alpha: {('0', '-pi/2', 'pi/2')[j % 3]}, d: {d}, theta: {theta}, r: {r}}}"
        )
    elements = "elements:\n  FV: {kind: viscous, along: all}\n  FS: {kind: coulomb, along: all}\n"
    head = (
        f"symgen: 1\nname: {name}\ngravity: [0, 0, -g]\nconstants: "
        f"{{{', '.join(constants)}}}\nframes:\n"
    )
    return (head + "\n".join(frames) + "\n" + elements).encode()


def _grown(ants: list[int], at: int, count: int) -> int:
    """Append a chain of `count` joints on frame `at`; return its last frame."""
    for _ in range(count):
        ants.append(at)
        at = len(ants)
    return at


def chain(n: int) -> bytes:
    """One chain of n joints."""
    return tree(f"chain{n}", range(n))


def humanoid(n: int) -> bytes:
    """Two legs on the base, a trunk, and on the trunk two arms and a head, n joints in all."""
    ants: list[int] = []
    trunk = max(1, n // 10)
    limb = (n - trunk) // 4
    top = _grown(ants, 0, trunk)
    for at in (0, 0, top, top):
        _grown(ants, at, limb)
    _grown(ants, top, n - len(ants))
    return tree(f"humanoid{n}", ants)


def hands(n: int) -> bytes:
    """A lift, two arms on it, and on each arm a hand of five fingers, n joints in all."""
    ants: list[int] = []
    top = _grown(ants, 0, 1)
    arm = max(1, (n - 1) // 8)
    wrists = [_grown(ants, top, arm) for _ in range(2)]
    for k in range(10):
        _grown(ants, wrists[k % 2], (n - len(ants)) // (10 - k))
    return tree(f"hands{n}", ants, prismatic=(1,))


TREES: dict[str, Callable[[int], bytes]] = {"chain": chain, "humanoid": humanoid, "hands": hands}
