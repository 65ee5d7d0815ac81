"""What the machine is, what it can do at most and how busy it was: what every page prints beside its times."""
import os
import platform
import subprocess
import sys
from pathlib import Path

QUIET_CORES = 0.1    # what others may use before times mean nothing


def cpu_name():
    with open("/proc/cpuinfo", encoding="utf-8") as info:
        for line in info:
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or "unknown CPU"


def pin(core):
    """Keep this process on one core, the last it may use when `core` is None -> the core."""
    allowed = sorted(os.sched_getaffinity(0))
    core = allowed[-1] if core is None else core
    if core not in allowed:
        raise ValueError(f"--core {core}: allowed are {allowed}")
    os.sched_setaffinity(0, {core})
    return core


def compiler(build):
    """The compiler that the build folder's cache names."""
    with open(os.path.join(build, "CMakeCache.txt"), encoding="utf-8") as cache:
        path = next((line.split("=", 1)[1].strip() for line in cache if line.startswith("CMAKE_CXX_COMPILER:")), "c++")
    done = subprocess.run([path, "--version"], capture_output=True, text=True, check=False)
    return done.stdout.splitlines()[0] if done.stdout else path


def busy():
    """Seconds of processor time that all processes of the machine have used, and seconds of all cores."""
    with open("/proc/stat", encoding="ascii") as stat:
        ticks = [int(v) for v in stat.readline().split()[1:9]]
    hertz = os.sysconf("SC_CLK_TCK")
    return (sum(ticks) - ticks[3] - ticks[4]) / hertz, sum(ticks) / hertz


def caches():
    """[[name, bytes]] of the data caches that core 0 reaches, smallest first."""
    found = []
    for index in sorted(Path("/sys/devices/system/cpu/cpu0/cache").glob("index*")):
        if (index / "type").read_text().strip() != "Instruction":
            kibibytes = int((index / "size").read_text().strip().rstrip("K"))
            found.append([f"L{(index / 'level').read_text().strip()}", kibibytes << 10])
    return found


class Neighbours:
    """How much of the other cores and of this one others used, between construction and share()."""

    def __init__(self):
        self._busy, self._all = busy()
        self._own = os.times()

    def share(self):
        """Processor time of others, in cores."""
        now_busy, now_all = busy()
        own = os.times()
        mine = sum(own[:4]) - sum(self._own[:4])
        elapsed = (now_all - self._all) / os.cpu_count()
        return max(0.0, (now_busy - self._busy - mine) / max(elapsed, 1e-9))


def describe(library, core, build):
    return {"cpu": cpu_name(), "core": core, "cores": os.cpu_count(), "system": platform.platform(),
            "compiler": compiler(build), "python": sys.version.split()[0], "isa": library.isa().decode(),
            "evicted_bytes": library.evicted_bytes()}


def limits(library):
    """Of this core: GB/s from memory, 1e9 float32 multiply-adds a second by vector width."""
    fma = {str(bits): library.fma_rate(bits) for bits in (256, 512)}
    return {"read_gbps": library.read_rate(library.evicted_bytes()),
            "fma_gmacs": {bits: rate for bits, rate in fma.items() if rate}}


def higher(one, other):
    """The higher rates of two measurements."""
    return {"read_gbps": max(one["read_gbps"], other["read_gbps"]),
            "fma_gmacs": {bits: max(rate, other["fma_gmacs"][bits]) for bits, rate in one["fma_gmacs"].items()}}


def quiet(used_cores):
    return used_cores <= QUIET_CORES


def busy_text(used_cores, cores, seconds):
    """How busy the machine was, as a page says it; in bold where that makes its times no result."""
    if quiet(used_cores):
        return f"Others used {used_cores:.2f} of {cores} cores meanwhile. The run took {seconds:.0f} s."
    return (f"**The machine was not quiet: others used {used_cores:.1f} of its {cores} cores. These times prove "
            "that the bench runs; they are no result: a tick that is interrupted counts with the interruption, "
            "and only the least times come near those of an idle machine. Run it again on one.**")


def built(results):
    """The line that every page begins with: date, machine, compiler, instruction set, version."""
    m = results["machine"]
    return (f"{results['date']}, {m['cpu']}, core {m['core']} of {m['cores']}, {m['system']}; dcloth "
            f"{results['version']}, built by {m['compiler']}, its kernels chose {m['isa']}; Python {m['python']}.")
