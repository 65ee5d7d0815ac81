"""What every contestant is to the bench: something that ticks stage by stage and can be asked for its vertices."""
import time

STAGES = ("static", "skeleton", "mesh", "displacement", "skinning")
NETWORK = STAGES[:4]
clock = time.perf_counter_ns


class Unavailable(Exception):
    """This peer cannot run here, and why."""


class Peer:
    """A runtime on a Case. Subclasses set the fields and give run(stage), which alone is timed; prepare(stage, frame)
    and finish(stage), inputs in and recurrent state round, are not."""

    name = version = precision = note = ""
    stages = STAGES       # those that it can run
    weight_bytes = 0
    tried = ()            # [(stage, graph, ms or why not)], for the page

    def reset(self):
        """Back to zero state."""
        raise NotImplementedError

    def prepare(self, stage, frame):
        """Untimed: hand over what the stage reads."""

    def run(self, stage):
        raise NotImplementedError

    def finish(self, stage):
        """Untimed: keep what the stage gave."""

    def network_output(self):
        """(D [m, 3], delta [n, 3]) of the last tick."""
        raise NotImplementedError

    def skinned(self):
        """Positions [n, 3] of the last tick as the peer itself skinned them, or None."""
        return

    def tick(self, frame):
        """One tick -> {stage: ns}."""
        times = {}
        for stage in self.stages:
            self.prepare(stage, frame)
            start = clock()
            self.run(stage)
            times[stage] = clock() - start
            self.finish(stage)
        return times


def milliseconds(call, repeats=4):
    """The least time of a call after one that is not counted."""
    call()
    best = None
    for _ in range(repeats):
        start = clock()
        call()
        spent = (clock() - start) * 1e-6
        best = spent if best is None else min(best, spent)
    return best


def fastest(stage, candidates, note):
    """{graph: make()} where make() gives (object, call without arguments) -> the fastest object.

    `note` receives (stage, graph, ms or why it cannot run); none that can run raises Unavailable."""
    best = None
    for graph, make in candidates.items():
        try:
            made, call = make()
            spent = milliseconds(call)
        except Exception as error:    # a runtime may refuse a graph in any way it likes
            note.append((stage, graph, f"{type(error).__name__}: {error}".splitlines()[0][:120]))
            continue
        note.append((stage, graph, spent))
        if best is None or spent < best[0]:
            best = spent, graph, made
    if best is None:
        raise Unavailable(f"{stage}: no graph runs: {note}")
    return best[2], best[1]
