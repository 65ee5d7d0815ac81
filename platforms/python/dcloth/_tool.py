"""The command line that comes in the wheel, as functions."""
from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ._error import Error

_Path = str | os.PathLike[str]
_STATUS = {1: "THRESHOLD", 2: "INPUT"}


def command_path() -> Path:
    """The `dcloth` executable of this package."""
    return Path(__file__).parent / "bin" / ("dcloth.exe" if os.name == "nt" else "dcloth")


def garments() -> dict[str, Path]:
    """The models that came with this package, by name, for `Model`. A release's wheel has the skirt and the robe in
    int8; one that was built from a clone has none."""
    return {file.stem: file for file in sorted((Path(__file__).parent / "garments").glob("*.dcloth"))}


def convert(
    bundle: _Path,
    out: _Path,
    *,
    precision: str = "fp32",
    max_error_mm: float | None = None,
    motion: Iterable[_Path] = (),
    calibrate: Iterable[_Path] = (),
    rank: str | int | None = None,
    stages: str | None = None,
) -> dict[str, Any]:
    """Makes a model file of a training bundle, as `dcloth convert` does.

    bundle        a training bundle (.safetensors)
    out           the model file to write (.dcloth)
    precision     "fp32", "fp16", "int8" or "auto"; auto needs `max_error_mm`, and `motion` or `calibrate`
    max_error_mm  largest allowed distance of any vertex from the fp32 model, in millimetres
    motion        sequences to measure on
    calibrate     sequences that a smaller basis is fitted to
    rank          rows of the displacement basis: "exact", "full", "auto" or a number
    stages        the last stage to store: "static", "skeleton" or "mesh"

    Returns the report, the object of `dcloth convert --json`.

    Raises Error: INPUT for files or options that are refused, THRESHOLD where `max_error_mm` is missed.
    """
    arguments: list[Any] = ["convert", "--output", out, "--precision", precision]
    if max_error_mm is not None:
        arguments += ["--max-error-mm", max_error_mm]
    for sequence in motion:
        arguments += ["--motion", sequence]
    for sequence in calibrate:
        arguments += ["--calibrate", sequence]
    if rank is not None:
        arguments += ["--rank", rank]
    if stages is not None:
        arguments += ["--stages", stages]
    return _run([*arguments, "--json", "--", bundle])


def evaluate(
    bundle: _Path, sequences: Iterable[_Path], *, precision: Iterable[str] = (), html: _Path | None = None
) -> dict[str, Any]:
    """Measures speed and error of a bundle on sequences with truth, as `dcloth evaluate` does.

    bundle     a training bundle (.safetensors)
    sequences  sequences (.safetensors)
    precision  of "fp32", "fp16" and "int8"; all three without it
    html       a page to write, with the table, plots and the garment in 3D

    Returns the object of `dcloth evaluate --json`: `variants`, each with `name`, `model_bytes`, `tick_ms`, `truth`
    (errors in millimetres and degrees) and others.

    Raises Error: INPUT for files or options that are refused.
    """
    arguments: list[Any] = ["evaluate"]
    for name in precision:
        arguments += ["--precision", name]
    if html is not None:
        arguments += ["--html", html]
    return _run([*arguments, "--json", "--", bundle, *sequences])


def _run(arguments: list[Any]) -> dict[str, Any]:
    words = [os.fspath(word) if isinstance(word, os.PathLike) else str(word) for word in arguments]
    done = subprocess.run([str(command_path()), *words], capture_output=True, text=True, encoding="utf-8",
                          errors="replace")
    if done.returncode != 0:
        said = [line for line in done.stderr.splitlines() if not line.startswith("Run with --help")]
        said = [line for line in said if line.startswith("dcloth: error: ")] or said
        text = "\n".join(said).removeprefix("dcloth: error: ")
        raise Error(_STATUS.get(done.returncode, "SYSTEM"),
                    text or f"dcloth {words[0]} ended with status {done.returncode} and without a word")
    report: dict[str, Any] = json.loads(done.stdout)
    return report
