"""200 hostile USD files: is anything fetched or executed, does any end the reader, is each named?

`python -m campaigns.hostile_usd [--keep DIR]` writes the files, and reads each in a process of its
own, of 4 GiB and 20 s of processor time. A server on this machine counts requests. A file outside
the folder has a word that no message may show. The table has for each family how many files were
read, how many were refused, how many refusals name a prim or a line besides the layer, and what
went wrong.
"""

from __future__ import annotations

import argparse
import http.server
import multiprocessing
import os
import random
import re
import resource
import tempfile
import threading
import time
import traceback
import zipfile
from collections import Counter
from collections.abc import Iterator
from multiprocessing.connection import Connection
from pathlib import Path

from pxr import Sdf, UsdUtils

from physics_crosscheck.harness.checks.plausibility.kinds import plausibility_findings
from physics_crosscheck.harness.modelfiles.readers import read_robot

SECONDS, BYTES, SECRET = 20, 4 << 30, "xyzzy"

ROBOT = """#usda 1.0
( defaultPrim = "arm" )
def Xform "arm"
{
    def Xform "link" (prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"])
    {
        float physics:mass = 1
        point3f physics:centerOfMass = (0, 0, 0.1)
        float3 physics:diagonalInertia = (0.01, 0.01, 0.01)
        quatf physics:principalAxes = (1, 0, 0, 0)
    }
    def PhysicsRevoluteJoint "hinge" (prepend apiSchemas = ["PhysicsDriveAPI:angular"])
    {
        rel physics:body1 = </arm/link>
        uniform token physics:axis = "X"
        point3f physics:localPos0 = (0, 0, 0)
        quatf physics:localRot0 = (1, 0, 0, 0)
        float physics:lowerLimit = -90
        float drive:angular:physics:stiffness = 1
        float newton:damping = 0.1
    }
}
"""

ARCS = ("references = {}", "payload = {}", "inherits = </arm>\n    references = {}")

File = tuple[str, str, bytes]
"""Family, name and content of a file."""


def arcs(target: str) -> Iterator[str]:
    """Yield layers that refer to a target, by each kind of arc."""
    yield f"#usda 1.0\n( subLayers = [@{target}@] )\n"
    for arc in ARCS:
        yield f'#usda 1.0\ndef "a" (\n    {arc.format(f"@{target}@")}\n)\n{{\n}}\n'
    choice = f'"one" ( references = @{target}@ ) {{ }}'
    yield (
        '#usda 1.0\ndef "a" (\n    variants = { string v = "one" }\n    prepend variantSets = "v"\n'
        f')\n{{\n    variantSet "v" = {{ {choice} }}\n}}\n'
    )


def outside(port: int, folder: Path) -> Iterator[File]:
    """Yield layers that refer to URLs and to files outside of their folder."""
    here = f"127.0.0.1:{port}/x.usda"
    for url in ("http", "https", "ftp", "omniverse", "s3", "file"):
        for i, text in enumerate(arcs(f"{url}://{here}")):
            yield "URL", f"url_{url}_{i}.usda", text.encode()
    secrets = "../secret.usda", f"{folder.parent}/secret.usda", "a/../../secret.usda"
    for name in ("/etc/passwd", "../../etc/passwd", "link.usda", *secrets):
        for i, text in enumerate(arcs(name)):
            yield "outside", f"out_{len(name)}_{i}.usda", text.encode()


def endless() -> Iterator[File]:
    """Yield layers without an end, and those that grow while they compose."""
    for i, text in enumerate(arcs("self.usda")):
        yield "endless", "self.usda" if not i else f"self_{i}.usda", text.encode()
    for name, other in ("pq", "qp"):
        yield "endless", f"{name}.usda", f"#usda 1.0\n( subLayers = [@{other}.usda@] )\n".encode()
    yield "endless", "child.usda", b'#usda 1.0\ndef "a" { def "b" ( references = </a> ) { } }\n'
    yield "endless", "inherits.usda", b'#usda 1.0\nclass "a" ( inherits = </a> ) { }\n'
    for depth in (500, 20000):
        text = "".join(f'def "p{i}" {{\n' for i in range(depth)) + "}" * depth
        yield "endless", f"deep_{depth}.usda", f"#usda 1.0\n{text}\n".encode()
    for count in (5, 9):  # ten to this power prims
        levels = [
            f'def "l{i}" {{\n' + "".join(
                f'def "c{k}" (references = </l{i + 1}>) {{ }}\n' for k in range(10)
            ) + "}\n"
            for i in range(count)
        ]  # fmt: skip
        text = f'#usda 1.0\n{"".join(levels)}def "l{count}" {{ }}\n'
        yield "endless", f"grows_{count}.usda", text.encode()
    for length, what in ((3_000_000, "float[] x = [{}]"), (3_000_000, "string x = '{}'")):
        body = what.format("1," * length if "float" in what else "x" * length)
        yield "huge", f"huge_{len(body)}.usda", f'#usda 1.0\ndef "a" {{ {body} }}\n'.encode()
    prims = "".join(f'def Xform "p{i}" {{ }}\n' for i in range(100_000))
    yield "huge", "many.usda", f"#usda 1.0\n{prims}".encode()
    body = '(prepend apiSchemas = ["PhysicsRigidBodyAPI"]) { float physics:mass = 1 }'
    bodies = "".join(f'def Xform "p{i}" {body}\n' for i in range(20_000))
    yield "huge", "bodies.usda", f"#usda 1.0\n{bodies}".encode()


def broken(folder: Path) -> Iterator[File]:
    """Yield text, crates and packages that are cut short or changed."""
    random.seed(1)
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.ImportFromString(ROBOT)
    layer.Export(str(folder / "whole.usdc"))
    (folder / "whole.usda").write_text(ROBOT, encoding="utf-8")
    UsdUtils.CreateNewUsdzPackage(str(folder / "whole.usda"), str(folder / "whole.usdz"))
    for suffix, count in (("usda", 8), ("usdc", 20), ("usdz", 12)):
        data = (folder / f"whole.{suffix}").read_bytes()
        for i in range(count):
            yield f"cut {suffix}", f"cut_{i}.{suffix}", data[: len(data) * i // count]
            noise = bytearray(data)
            for _ in range(i + 1):
                noise[random.randrange(len(data))] = random.randrange(256)
            yield f"changed {suffix}", f"noise_{i}.{suffix}", bytes(noise)
        yield "mixed", f"usda_as_{suffix}.{suffix}", b"#usda 9.9\n" + data[:40]
    for i, name in enumerate(("../../x.usda", "/tmp/x.usda", "a.py", "x.usda")):
        path = folder / f"zip_{i}.usdz"
        method = zipfile.ZIP_DEFLATED if i == 3 else zipfile.ZIP_STORED
        with zipfile.ZipFile(path, "w", method) as z:
            z.writestr(name, ROBOT if i != 3 else " " * 10_000_000)
        yield "packages", path.name, path.read_bytes()
    heads = b"", b"\0" * 100, b"\xff\xfe", b"\xef\xbb\xbf#usda 1.0\n", b"PXR-USDC"
    for i, head in enumerate(heads):
        yield "mixed", f"head_{i}.usd", head


def wrong_values() -> Iterator[File]:
    """Yield robots with values that are not numbers, of another type, or nowhere."""
    edits = [
        ("= </arm/link>", f"= {one}") for one in ("</nowhere>", "</arm/hinge>", "[]", "</arm>")
    ]
    edits += [('"X"', one) for one in ('"W"', '""', '"XYZ"')]
    edits += [("= (1, 0, 0, 0)", f"= {one}") for one in ("(0, 0, 0, 0)", "(nan, 0, 0, 0)")]
    for line in ROBOT.splitlines():
        kind, _, rest = line.strip().partition(" ")
        name, _, value = rest.partition(" = ")
        if kind == "float":
            edits += [(f"{name} = {value}", f"{name} = {one}") for one in ("nan", "-inf", "-1e38")]
            edits += [(f"float {name} = {value}", f'string {name} = "x"'),
                      (f"float {name} = {value}", f"double[] {name} = [1, 2]")]  # fmt: skip
        elif kind in ("point3f", "float3"):
            edits += [(f"{name} = {value}", f"{name} = ({one}, 0, 0)") for one in ("nan", "-inf")]
            edits.append((f"{kind} {name} = {value}", f'token {name} = "x"'))
    for i, (old, new) in enumerate(edits):
        assert old in ROBOT
        yield "wrong values", f"value_{i}.usda", ROBOT.replace(old, new, 1).encode()


def judge(path: Path, answer: Connection) -> None:
    """Send what reading a file gives: the words of a refusal, or none."""
    os.chdir(path.parent)
    resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
    try:
        robot = read_robot(Path(path.name))
        if not robot.obstacles:
            plausibility_findings(robot)
        answer.send([str(one) for one in robot.obstacles])
    except BaseException:  # any exception is a fault of the reader
        answer.send(traceback.format_exc())


def outcome(path: Path) -> tuple[str, str]:
    """Return what became of a file, and its words."""
    fork = multiprocessing.get_context("fork")
    receive, send = fork.Pipe(duplex=False)
    process = fork.Process(target=judge, args=(path, send))
    process.start()
    send.close()
    try:
        words = receive.recv()
    except EOFError:
        process.join()
        return "died", f"signal or code {process.exitcode}"
    process.join()
    if isinstance(words, str):
        return "raised", words.strip().splitlines()[-1]
    if SECRET in str(words):
        return "shown", str(words)
    if not words:
        return "read", ""
    first = words[0]
    if path.name not in first and not any(one.name in first for one in path.parent.iterdir()):
        return "unnamed", first
    is_placed = re.search(r":\d+: |</?[a-z]|/arm", first)
    return "refused by line or prim" if is_placed else "refused by layer", first


def main() -> None:
    """Print a table by family, and all that went wrong."""
    parser = argparse.ArgumentParser(prog="python -m campaigns.hostile_usd", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--keep", type=Path, help="folder for the files [a temporary one]")
    parser.add_argument("--words", action="store_true", help="print each refusal")
    chosen = parser.parse_args()
    requests: list[str] = []

    class Counting(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            requests.append(self.path)
            self.send_error(404)

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Counting)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    above = chosen.keep or Path(tempfile.mkdtemp())
    folder = above / "files"
    folder.mkdir(parents=True, exist_ok=True)
    (above / "secret.usda").write_text(
        f'#usda 1.0\ndef "{SECRET}" {{ }}\n{SECRET}', encoding="utf-8"
    )
    (folder / "link.usda").unlink(missing_ok=True)
    (folder / "link.usda").symlink_to(above / "secret.usda")
    files = [*outside(server.server_port, folder), *endless(), *broken(folder), *wrong_values()]
    for _, name, data in files:
        (folder / name).write_bytes(data)
    counts: Counter[tuple[str, str]] = Counter()
    for family, name, _ in files:
        began = time.perf_counter()
        became, words = outcome(folder / name)
        counts[family, became] += 1
        if chosen.words or not became.startswith(("refused", "read")):
            seconds = time.perf_counter() - began
            print(f"{family}, {name}: {became} in {seconds:.1f} s: {words[:300]}", flush=True)
    kinds = sorted({became for _, became in counts})
    print(f"\n| family | files | {' | '.join(kinds)} |\n|---|---|{'---|' * len(kinds)}")
    for family in dict.fromkeys(one for one, _, _ in files):
        row = [counts[family, kind] for kind in kinds]
        print(f"| {family} | {sum(row)} | {' | '.join(map(str, row))} |")
    print(f"\n{len(files)} files; requests to the server: {len(requests)}")


if __name__ == "__main__":
    main()
