"""Measures the bundled garments and the scaling curves, and writes their pages; run.sh builds what this needs.

    python3 -m results --build BUILD --shared libdcloth.so --work DIR --pages DIR [--quick]
    python3 -m results --from results.json --pages DIR

Writes DIR/results/RESULTS.md, DIR/scaling/SCALING.md and their pictures; figures also in WORK/results.json.
"""
import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from pages import machine
from pages.steps import Steps

from . import page

ROOT = Path(__file__).resolve().parents[2]


def arguments(argv):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=Path, help="a build folder with tools and benches")
    parser.add_argument("--shared", type=Path, help="the engine as a shared library")
    parser.add_argument("--work", type=Path, help="for results.json")
    parser.add_argument("--pages", type=Path, required=True)
    parser.add_argument("--from", dest="kept", type=Path,
                        help="write the pages of figures that were kept; measure nothing")
    parser.add_argument("--quick", action="store_true", help="few points and frames, one garment: does it run at all")
    options = parser.parse_args(argv)
    missing = [name for name in ("build", "shared", "work") if getattr(options, name) is None]
    if missing and options.kept is None:
        parser.error(f"needs --{' and --'.join(missing)}, or --from")
    return options


def measured(options):
    from peers.engine_peer import Library
    from scaling import measure as scaling

    from . import measure
    library, started = Library(options.build / "libdcloth_peers.so"), time.gmtime()
    results = {"date": time.strftime("%Y-%m-%d", started), "quick": options.quick, "caches": machine.caches(),
               "machine": machine.describe(library, max(os.sched_getaffinity(0)), options.build),
               "limits": machine.limits(library)}
    with tempfile.TemporaryDirectory() as folder:
        steps = Steps()
        results |= measure.run(steps, ROOT, options.build / "dcloth", options.shared, library, folder, options.quick)
        results["run"] = steps.summary()
        steps = Steps()
        results["scaling"] = scaling.run(steps, options.build, folder, options.quick)
        results["scaling"]["run"] = steps.summary()
    results["version"] = version(results)
    return results


def version(results):
    """The library's, and the commit where there is one."""
    said = next(iter(results["garments"].values()))["evaluate"]["version"]
    commit = subprocess.run(["git", "-C", str(ROOT), "rev-parse", "--short", "HEAD"], capture_output=True, text=True,
                            check=False)
    return f"{said} ({commit.stdout.strip()})" if commit.returncode == 0 else said


def write(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(path.name + ".part")
    part.write_text(text, encoding="utf-8")
    os.replace(part, path)


def main(argv=None):
    options = arguments(argv)
    if options.kept:
        results = json.loads(options.kept.read_text(encoding="utf-8"))
    else:
        results = measured(options)
        write(options.work / "results.json", json.dumps(results, indent=1) + "\n")
        results = json.loads(json.dumps(results))    # the pages of kept figures are the same
    from scaling import page as scaling_page
    files = {"results/RESULTS.md": page.markdown(results), "scaling/SCALING.md": scaling_page.markdown(results)}
    files |= {f"results/{name}": text for name, text in page.pictures(results).items()}
    files |= {f"scaling/{name}": text for name, text in scaling_page.pictures(results).items()}
    for name, text in files.items():
        write(options.pages / name, text)
    print(page.goals_table(results))
    print(page.machine_text(results))
    return 0


if __name__ == "__main__":
    sys.exit(main())
