"""Commands one after the other, with what others used of the machine during each."""
import json
import subprocess
import sys
import time

from . import machine


class Steps:
    def __init__(self):
        self.started, self.taken = time.monotonic(), []
        self._all = machine.Neighbours()

    def run(self, name, *command):
        """Standard output of a command; ends the program where it fails."""
        command = [str(part) for part in command]
        print(f"{time.monotonic() - self.started:5.0f} s  {name}", file=sys.stderr, flush=True)
        neighbours, started = machine.Neighbours(), time.monotonic()
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            sys.exit(f"{' '.join(command)}: exit {done.returncode}\n{done.stderr}")
        self.taken.append([name, time.monotonic() - started, neighbours.share()])
        return done.stdout

    def json(self, name, *command):
        return json.loads(self.run(name, *command))

    def summary(self):
        """What every page says of the run: seconds, and what others used on average and by step."""
        return {"seconds": time.monotonic() - self.started, "others_used_cores": self._all.share(), "steps": self.taken}


def text(summary, cores, quick=False):
    """The paragraph for the page. A disturbance that the average hides is named."""
    lines = ["**A quick run, of few points and frames: no result.**"] if quick else []
    lines += [machine.busy_text(summary["others_used_cores"], cores, summary["seconds"])]
    busy = [f"{name} ({used:.1f})" for name, _, used in summary["steps"] if not machine.quiet(used)]
    if busy and machine.quiet(summary["others_used_cores"]):
        lines.append(f"Of {len(summary['steps'])} steps others used more than {machine.QUIET_CORES} cores in: "
                     f"{', '.join(busy)}.")
    return "\n".join(lines)
