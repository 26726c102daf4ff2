"""How a case of each format is made of sound files by a random generator."""

from __future__ import annotations

import json
import random
from collections.abc import Callable

from fuzz import archives, seeds, texts, xml_texts
from fuzz.mutations import mutated


def either(
    rng: random.Random,
    sound: tuple[bytes, ...],
    structured: Callable[[random.Random], bytes],
    share: float = 0.6,
    tokens: tuple[bytes, ...] | None = None,
) -> bytes:
    """A case that is aware of the structure, or any bytes changed, or both."""
    content = structured(rng) if rng.random() < share else rng.choice(sound)
    if rng.random() < share and content not in sound:
        return content
    return (
        mutated(content, rng, sound)
        if tokens is None or rng.random() < 0.5
        else mutated(content, rng, sound, tokens)
    )


def small_first(rng: random.Random, items: tuple) -> object:
    """One of the items, the first ones more often."""
    return items[min(int(rng.expovariate(0.4)), len(items) - 1)]


def make_robot(rng: random.Random) -> bytes:
    return either(
        rng,
        seeds.robots(),
        lambda rng: texts.structured(
            small_first(rng, seeds.robot_tables()), rng, others=seeds.robot_tables()
        ),
        tokens=texts.TOKENS,
    )


def make_expression(rng: random.Random) -> bytes:
    table = small_first(rng, seeds.robot_tables()[:3])
    spots = [
        path
        for path in texts.places(table)
        if path
        and path[0]
        in (
            "frames",
            "gravity",
            "elements",
            "constants",
            "constraints",
            "limits",
            "drives",
            "values",
        )
    ]
    for _ in range(rng.choice((1, 2, 4))):
        table = texts.changed(
            table,
            rng.choice(spots),
            texts.Raw("'" + texts.expression(rng, ("q1", "q2", "D2", "g"), 5) + "'"),
        )
    return texts.yaml_text(table).encode()


def make_derived(rng: random.Random) -> bytes:
    """Files that still describe a robot more often: one number or expression changed."""
    table = small_first(
        rng,
        (
            seeds.robot_tables()[0],
            seeds.robot_tables()[4],
            seeds.robot_tables()[2],
            seeds.robot_tables()[3],
        ),
    )
    spots = [
        path
        for path in texts.places(table)
        if path
        and path[0]
        in (
            "frames",
            "gravity",
            "constants",
            "elements",
            "values",
            "drives",
            "limits",
            "title",
            "source",
            "name",
        )
    ]
    value = rng.choice(
        (
            "0",
            "1e-60",
            "1e60",
            "123456789.123456789",
            "-1",
            "pi/7",
            "1e-30",
            "D2*1e30",
            "sqrt(2)",
            "sin(0.1)",
            "1/3",
            "q2",
            "-g",
            "g**3",
            "'x y'",
            "title",
            texts.expression(rng, ("q1", "D2", "g"), 3),
        )
    )
    return texts.yaml_text(texts.changed(table, rng.choice(spots), texts.Raw(value))).encode()


def make_par(rng: random.Random) -> bytes:
    return either(rng, seeds.par_files(), lambda rng: texts.par(rng.choice(seeds.par_files()), rng))


def make_urdf(rng: random.Random) -> bytes:
    return either(
        rng,
        seeds.urdf_files(),
        lambda rng: xml_texts.changed(rng.choice(seeds.urdf_files()), rng, xml_texts.URDF),
    )


def make_mjcf(rng: random.Random) -> bytes:
    return either(
        rng,
        seeds.mjcf_files(),
        lambda rng: xml_texts.changed(rng.choice(seeds.mjcf_files()), rng, xml_texts.MJCF),
        0.75,
    )


def make_study(rng: random.Random) -> bytes:
    sound = tuple(texts.yaml_text(table).encode() for table in seeds.study_tables())
    return either(
        rng,
        sound,
        lambda rng: texts.structured(
            rng.choice(seeds.study_tables()), rng, ("pi", "1", "2"), seeds.study_tables()
        ),
        tokens=texts.TOKENS,
    )


def make_motion(rng: random.Random) -> bytes:
    table = {
        "controller": {"rate": 500, "reference": {"motion": seeds.MOTION}},
        "excitation": {
            "parts": [{k: v for k, v in part.items() if k != "p"} for part in seeds.MOTION["parts"]]
        },
    }
    return texts.structured(table, rng, ("pi", "1"), (table,))


def make_csv(rng: random.Random) -> bytes:
    return either(rng, (seeds.csv_file(),), lambda rng: texts.table(seeds.csv_file(), rng))


def make_csv_gz(rng: random.Random) -> bytes:
    return archives.gzipped(rng.choice((seeds.csv_file(), texts.table(seeds.csv_file(), rng))), rng)


def make_npz(rng: random.Random) -> bytes:
    return either(rng, (seeds.npz_file(),), lambda rng: archives.npz(seeds.npz_members(), rng), 0.8)


def make_mat(rng: random.Random) -> bytes:
    return either(
        rng,
        seeds.mat_files(),
        lambda rng: archives.mat5(rng) if rng.random() < 0.8 else archives.mat4(rng),
    )


def make_mat73(rng: random.Random) -> bytes:
    return mutated(rng.choice(seeds.mat73_files()), rng, seeds.mat73_files())


def make_parquet(rng: random.Random) -> bytes:
    content = bytearray(rng.choice(seeds.parquet_files()))
    if rng.random() < 0.5:  # the footer, where shapes and places stand
        length = int.from_bytes(content[-8:-4], "little")
        for _ in range(rng.choice((1, 1, 2, 5))):
            content[
                len(content) - 8 - rng.randrange(length + 8 if rng.random() < 0.1 else length)
            ] = rng.choice((0, 0xFF, 0x7F, 0x80, rng.randrange(256)))
        return bytes(content)
    return mutated(bytes(content), rng, seeds.parquet_files())


def make_bag(ending: str, rng: random.Random) -> bytes:
    return mutated(rng.choice(seeds.bag_files(ending)), rng, seeds.bag_files(ending))


def make_ros2(rng: random.Random) -> bytes:
    """The folder of a bag as an archive: its description, its storage or both changed."""
    members = dict(rng.choice(seeds.bag_folders()))
    tables = seeds.bag_tables()
    structured = lambda rng: texts.structured(rng.choice(tables), rng, ("1", "pi"), tables)  # noqa: E731
    what = rng.choice(("description", "description", "storage", "both"))
    for name, data in members.items():
        if name == "metadata.yaml" and what != "storage":
            members[name] = either(rng, (data,), structured, tokens=texts.TOKENS)
        elif name != "metadata.yaml" and what != "description":
            members[name] = mutated(data, rng, seeds.bag_files(name.partition(".")[2]))
    return archives.stored(members)


def make_model(rng: random.Random) -> bytes:
    tokens = (
        *(
            word.encode()
            for word in (
                "(" * 10000 + ")" * 10000,
                "[" * 200,
                "-" * 20000 + "1",
                "not " * 5000,
                "1" + "+1" * 20000,
                "a" + ".b" * 5000,
                "9**9**9",
                "np.zeros(10**12)",
                "np.load('x')",
                "import os\n",
                "eval('1')",
                "().__class__",
                "f'{1}'",
                "lambda: 0",
                "yield",
                "while True: pass\n",
                "raise ValueError\n",
                "class A: pass\n",
                "\x00",
                "\f",
                "# coding: utf-7\n",
                "None",
                "0",
                "'x'",
                "{}",
                "np.nan",
                "JOINTS",
                "pass",
            )
        ),
    )
    return mutated(
        rng.choice(seeds.model_files()),
        rng,
        seeds.model_files(),
        tokens
        if rng.random() < 0.6
        else (b"0", b"1", b"", b"\n", b"    ", b"q", b"np.", b"'", b"(", b")", b",", b"-1"),
    )


def make_checkpoint(rng: random.Random) -> bytes:
    members = {
        f"{name}.npy": archives.plain_npy(x) for name, x in seeds.checkpoint_arrays().items()
    }
    return (
        archives.npz(members, rng)
        if rng.random() < 0.7
        else mutated(archives.npz(members, random.Random(1)), rng)
    )


def make_settings(rng: random.Random) -> bytes:
    """study.json of a folder of runs."""
    return texts.json_case({"a": {"b": [1, 2.5]}, "version": "1", "runs": 7}, rng)


def make_estimate(rng: random.Random) -> bytes:
    """estimate.json: its data or its bytes changed."""
    if rng.random() < 0.7:
        return texts.json_case(json.loads(seeds.estimate_file()), rng)
    return mutated(seeds.estimate_file(), rng, (seeds.estimate_file(),), texts.TOKENS)
