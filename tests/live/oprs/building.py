"""The module, compiled against declarations of our own, as a program that stands for a kernel."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[3]
MODULE = ROOT / "semmap_log" / "live" / "oprs" / "semantic_map_oprs"
STUB = Path(__file__).parent / "stub"

STRICT = ("-std=c99", "-D_POSIX_C_SOURCE=200809L", "-Wall", "-Wextra", "-Werror")
SANITIZED = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")
OLDER_X_OPEN = ("-D_XOPEN_SOURCE=700",)
"""The stub's own timer is not in plain POSIX."""


def compiler() -> str | None:
    """Return the C compiler of this machine."""
    return shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")


def has_sanitizers(folder: Path) -> bool:
    """Tell whether this compiler has the address sanitizer, and programs built with it run."""
    source = folder / "nothing.c"
    source.write_text("int main(void) { return 0; }\n", encoding="utf-8")
    program = folder / "nothing"
    command = [compiler() or "cc", *SANITIZED, str(source), "-o", str(program)]
    built = subprocess.run(command, capture_output=True, check=False)
    return built.returncode == 0 and subprocess.run([program], check=False).returncode == 0


def build_stub(folder: Path, *options: str) -> Path:
    """Compile module and stub kernel into a program; warnings are errors.

    Raises:
        AssertionError: The compiler has something to say.
    """
    objects = []
    for source in [*sorted(MODULE.glob("*.c")), STUB / "stub_kernel.c"]:
        objects.append(folder / f"{source.stem}.o")
        of_stub = OLDER_X_OPEN if source.parent == STUB else ()
        _run(*STRICT, *of_stub, "-g", "-O1", *options, f"-I{STUB}", f"-I{MODULE}",
             "-c", source, "-o", objects[-1])  # fmt: skip
    program = folder / "stub_kernel"
    _run(*options, *objects, "-o", program)
    return program


def _run(*words: object) -> None:
    command = [compiler() or "cc", *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (0, "") == (done.returncode, done.stderr)
