#!/usr/bin/env python3
"""Breaks copies of the C# binding in ways a slip of the pen does; check_binding.py must refuse each.

Usage: seed_binding_faults.py CORE_FOLDER DESCRIBE_SOURCE MANIFEST MCS MONO
"""
import subprocess
import sys
import tempfile
from pathlib import Path

# File, text that stands in it once, what replaces it.
FAULTS = [
    ("NativeTypes.cs", "public uint position_format;\n        public uint normal_format;",
     "public uint normal_format;\n        public uint position_format;"),
    ("NativeTypes.cs", "public fixed byte text[240];", "public fixed byte text[248];"),
    ("NativeTypes.cs", "public float lag_seconds;", "public double lag_seconds;"),
    ("NativeTypes.cs", "public ulong scratch_size;", "public uint scratch_size;"),
    ("Native.cs", "dcloth_cloth_skin(dcloth_cloth* cloth, dcloth_pose* pose, float blend",
     "dcloth_cloth_skin(dcloth_cloth* cloth, dcloth_pose* pose, double blend"),
    ("Native.cs", "dcloth_cloth_save(dcloth_cloth* cloth, void* state, UIntPtr size",
     "dcloth_cloth_save(dcloth_cloth* cloth, void* state, uint size"),
    ("Native.cs", "CallingConvention C = CallingConvention.Cdecl", "CallingConvention C = CallingConvention.StdCall"),
    ("NativeConstants.cs", "DCLOTH_STAGES_SKELETON = 3", "DCLOTH_STAGES_SKELETON = 2"),
]


def main():
    if len(sys.argv) != 6:
        sys.exit(__doc__)
    core, describe, manifest, mcs, mono = sys.argv[1:]
    check = Path(__file__).with_name("check_binding.py")
    for name, before, after in FAULTS:
        with tempfile.TemporaryDirectory() as folder:
            sources = {path.name: path.read_text(encoding="utf-8") for path in Path(core).glob("*.cs")}
            if sources[name].count(before) != 1:
                print(f"error: the fault {before!r} no longer fits {name} once", file=sys.stderr)
                return 1
            sources[name] = sources[name].replace(before, after)
            for file, text in sources.items():
                (Path(folder) / file).write_text(text, encoding="utf-8")
            program = Path(folder) / "describe.exe"
            subprocess.run([mcs, "-unsafe", "-langversion:7.2", "-nowarn:1030", f"-out:{program}", describe,
                            *sorted(map(str, Path(folder).glob("*.cs")))], check=False, capture_output=True)
            if not program.exists():  # the rest of the core does not compile against it: found, too
                print(f"seeded: {after!r}: refused by the compiler")
                continue
            done = subprocess.run([sys.executable, check, manifest, "dcloth", "--", mono, program], capture_output=True,
                                  text=True)
            if done.returncode == 0:
                print(f"error: a seeded fault was not found: {after!r}", file=sys.stderr)
                return 1
            print("seeded: " + done.stderr.splitlines()[0])
    return 0


if __name__ == "__main__":
    sys.exit(main())
