"""Whatever the bytes, loading gives a Robot or a DescriptionError with file and line, and nothing
else.
"""

from importlib import resources

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from symgen.description import Robot, parse_robot
from symgen.errors import DescriptionError

FOLDER = resources.files("symgen.description") / "robots"
VALID = [
    (FOLDER / f"{name}.yaml").read_bytes() for name in ("planar_2r", "emps_asymmetric", "scara")
]
TOKENS = [
    *(b": ", b"- ", b"[", b"]", b"{", b"}", b",", b"&a ", b"*a", b"!!int ", b"|\n", b">\n", b"'",
      b'"', b"#", b"\n", b"\t", b"---\n", b"...\n", b"%YAML 1.1\n", b"? ", b"<<: "),
    *(b"\x00", b"\xff", b"\xc3", "é".encode(), b"\r", b"\xe2\x80\xa8", b"q1", b"all", b"null",
      b"true", b"1e308", b"-1", b"0", b".nan", b"99999999999999999999", b"(", b")", b"**", b"/",
      b"sin(", b"sqrt(-"),
    *(b"sigma: 1", b"mu: 0", b"form: {1: q1**2}", b"when: positive",
      b"loops: [{cut: 1, twin: 2}]\n", b"constraints: {q1: q2}\n", b"massless: [1]\n",
      b"symgen: 1\n"),
]  # fmt: skip


def load(content):
    try:
        assert isinstance(parse_robot(content, "fuzz.yaml"), Robot)
    except DescriptionError as error:
        assert error.file == "fuzz.yaml"
        assert error.line >= 1
        assert error.line <= len(content.splitlines()) + 1 + content.count(
            "\x85".encode()
        ) + content.count(b"\xe2\x80")


@given(st.binary(max_size=200))
@settings(max_examples=200)
def test_any_bytes(content):
    load(content)


@given(st.lists(st.sampled_from(TOKENS), max_size=30).map(b"".join))
@settings(max_examples=300)
def test_any_yaml_tokens(content):
    load(content)


@st.composite
def mutated(draw):
    content = draw(st.sampled_from(VALID))
    for _ in range(draw(st.integers(1, 4))):
        start = draw(st.integers(0, len(content)))
        length = draw(st.sampled_from([0, 0, 1, 2, 8, 40]))
        content = (
            content[:start] + draw(st.sampled_from([b"", *TOKENS])) + content[start + length :]
        )
    return content


@given(mutated())
@settings(max_examples=300, suppress_health_check=[HealthCheck.too_slow])
def test_mutated_files(content):
    load(content)


NODES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=8)
    | st.sampled_from(["q1", "all", "D2", "pi/2"]),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.text(max_size=3) | st.integers(0, 3), inner, max_size=3)
    ),
    max_leaves=6,
)
KEYS = [
    "name",
    "title",
    "source",
    "gravity",
    "constants",
    "frames",
    "loops",
    "constraints",
    "massless",
    "elements",
    "drives",
    "limits",
    "values",
]


@given(st.sampled_from(KEYS), NODES)
@settings(max_examples=300)
def test_any_value_of_any_key(key, node):
    import json

    lines = VALID[0].decode().splitlines()
    start = (
        next(i for i, line in enumerate(lines) if line.startswith(f"{key}:"))
        if f"\n{key}:".encode() in VALID[0]
        else len(lines)
    )
    end = next(
        (i for i in range(start + 1, len(lines)) if not lines[i].startswith(" ")), len(lines)
    )
    text = json.dumps(node, ensure_ascii=False)  # JSON is YAML
    load("\n".join([*lines[:start], f"{key}: {text}", *lines[end:], ""]).encode("utf-8", "replace"))
