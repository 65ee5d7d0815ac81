"""Full disks, read-only targets, kill -9 at every file call and at random times, conversions into one target at once:
a file is the old one or the new one, never half of either, and a failed command leaves nothing behind."""
import errno
import os
import random
import shutil
import signal
import subprocess
import threading
import time

import pytest

from checks import leftovers, refused

PRELOAD = os.environ.get("DCLOTH_FAULT_PRELOAD")
OUTPUTS = ["model", "report", "run.safetensors", "run.pc2", "run.html", "trace"]  # evaluate measures, which takes long
ERRORS = [errno.ENOSPC, errno.EIO, errno.EROFS, errno.EDQUOT]
MOST_CALLS = 40


def command(files, kind, out):
    """Arguments that write `out`."""
    return {"model": ["convert", files.bundle, "--precision", "int8", "-o", out],
            "report": ["convert", files.bundle, "-o", out.parent / "model_beside", "--report", out],
            "trace": ["profile", files.model, files.bare, "--trace", out],
            "page": ["evaluate", files.bundle, files.walk, "--precision", "int8", "--html", out],
            }.get(kind, ["run", files.model, files.bare, "-o", out])


def named(folder, kind):
    return folder / (kind if "." in kind else kind + (".html" if kind == "page" else ".out"))


def faulty(binary, arguments, at, kind):
    return subprocess.run([binary, *map(str, arguments)], capture_output=True, timeout=300,
                          env={**os.environ, "LD_PRELOAD": PRELOAD, "FAULT_AT": str(at), "FAULT_KIND": str(kind)})


@pytest.fixture(scope="module", autouse=True)
def preload():
    if PRELOAD is None or not os.access(PRELOAD, os.R_OK):
        pytest.fail("set DCLOTH_FAULT_PRELOAD to the built fault_preload library")


@pytest.mark.parametrize("when", ["before", "half", "after"])
@pytest.mark.parametrize("kind", ["model", "report", "run.pc2"])
def test_killed_at_every_file_call(binary, files, tmp_path, kind, when):
    out = named(tmp_path, kind)
    assert faulty(binary, command(files, kind, out), 0, when).returncode == 0
    whole, old, replaced, kept = out.read_bytes(), b"the old file", 0, 0
    for at in range(1, MOST_CALLS):
        out.write_bytes(old)
        code = faulty(binary, command(files, kind, out), at, when).returncode
        data = out.read_bytes()
        if code == 0:
            break
        assert code == -signal.SIGKILL
        assert data in (old, whole), f"half a file at call {at}"
        replaced += data == whole
        kept += data == old
    assert code == 0, "more file calls than MOST_CALLS"
    assert data == whole, "the last command was hindered by what the killed ones left"
    assert kept >= 3, "no call before the rename was met"
    assert replaced >= (2 if when == "after" else 1), "no call after the rename was met"
    # What lies beside is temporary by its name, one file a kill at most.
    beside = leftovers(tmp_path, {out.name, "model_beside"})
    assert all(name.endswith(".tmp") for name in beside) and len(beside) <= 2 * kept


@pytest.mark.parametrize("kind, error", [(kind, errno.ENOSPC) for kind in OUTPUTS] + [("model", e) for e in ERRORS[1:]])
def test_every_file_call_fails(binary, files, tmp_path, kind, error):
    """One call at a time: exit 2 with the system's reason, both outputs as they were, no temporary file."""
    out = named(tmp_path, kind)
    failed = 0
    for at in range(1, MOST_CALLS):
        out.write_bytes(b"the old file")
        beside = tmp_path / "model_beside"
        beside.write_bytes(b"the old model")
        result = faulty(binary, command(files, kind, out), at, int(error))
        assert leftovers(tmp_path, {out.name, beside.name}) == []
        if result.returncode == 0:
            assert out.read_bytes() != b"the old file"
            # A directory that cannot be flushed is no reason to undo a file: those calls fail unseen. Two files, two.
            if at > failed + 2:
                break
            continue
        failed += 1
        assert result.returncode == 2
        assert os.strerror(error).encode() in result.stderr, result.stderr
        assert out.read_bytes() == b"the old file"
        # Only a rename that fails after another one has been done parts the two.
        assert beside.read_bytes() == b"the old model" or (kind == "report" and b"cannot be replaced" in result.stderr)
    assert failed >= 4, "create, write, flush and rename were not all met"


def mounted(binary, folder, options, script, arguments):
    """A command with `folder` on a file system of its own; what lies there afterwards, name to bytes, on stdout."""
    text = (f"mount {options} '{folder}' && {script}\n"
            f"'{binary}' {' '.join(repr(str(a)) for a in arguments)} 1>&2; code=$?; ls -A '{folder}'; exit $code")
    return subprocess.run(["unshare", "-rm", "sh", "-c", text], capture_output=True, text=True, timeout=300)


def own_mounts():
    probe = ["unshare", "-rm", "sh", "-c", "mount -t tmpfs none /mnt"]
    return shutil.which("unshare") is not None and subprocess.run(probe, capture_output=True).returncode == 0


needs_mounts = pytest.mark.skipif(not own_mounts(), reason="this system gives no mount namespace to its users")


@needs_mounts
@pytest.mark.parametrize("kind", [*OUTPUTS, "page"])
def test_full_disk(binary, files, tmp_path, kind):
    folder = tmp_path / "disk"
    folder.mkdir()
    out = named(folder, kind)
    old = f"echo old > '{out}'"
    result = mounted(binary, folder, "-t tmpfs -o size=8k none", old, command(files, kind, out))
    assert result.returncode == 2, result
    assert "No space left on device" in result.stderr and str(out.parent) in result.stderr
    assert result.stdout.split() == [out.name]


@needs_mounts
@pytest.mark.parametrize("kind", OUTPUTS)
def test_read_only_disk(binary, files, tmp_path, kind):
    folder = tmp_path / "disk"
    folder.mkdir()
    out = named(folder, kind)
    script = f"echo old > '{out}' && mount -o remount,ro '{folder}'"
    result = mounted(binary, folder, "-t tmpfs none", script, command(files, kind, out))
    assert result.returncode == 2, result
    assert str(folder) in result.stderr
    assert result.stdout.split() == [out.name]


@pytest.mark.parametrize("kind", OUTPUTS)
def test_read_only_file(dcloth, files, tmp_path, kind):
    out = named(tmp_path, kind)
    out.write_bytes(b"old")
    out.chmod(0o444)
    refused(dcloth(*command(files, kind, out)), out, "write permission")
    assert out.read_bytes() == b"old"
    assert leftovers(tmp_path, {out.name}) == []


def test_killed_at_random_times(binary, files, tmp_path):
    """At times that no list of calls knows of; the old file is a model too."""
    out = tmp_path / "skirt.dcloth"
    models = []
    for precision in ("fp32", "int8"):
        subprocess.run([binary, "convert", files.bundle, "--precision", precision, "-o", out], check=True)
        models.append(out.read_bytes())
    started = time.monotonic()
    subprocess.run([binary, "convert", files.bundle, "-o", out], check=True)
    whole_time = time.monotonic() - started
    generator = random.Random(5)
    killed = 0
    for turn in range(60):
        convert = subprocess.Popen([binary, "convert", files.bundle, "--precision", ("fp32", "int8")[turn % 2],
                                    "-o", out])
        time.sleep(generator.uniform(0, 1.2 * whole_time))
        convert.kill()
        killed += convert.wait() == -signal.SIGKILL
        assert out.read_bytes() in models, turn
        assert subprocess.run([binary, "inspect", out], capture_output=True).returncode == 0
    assert killed >= 10, "nearly all were done before they were killed"
    assert all(name.endswith(".tmp") for name in leftovers(tmp_path, {out.name}))


def test_conversions_into_one_target(binary, files, tmp_path):
    """Eight at a time while others read: every read is one whole model, and nothing is left beside it."""
    out = tmp_path / "skirt.dcloth"
    precisions = ["fp32", "fp16", "int8"]
    models = []
    for precision in precisions:
        subprocess.run([binary, "convert", files.bundle, "--precision", precision, "-o", out], check=True)
        models.append(out.read_bytes())
    seen, torn, done = set(), [], threading.Event()

    def read():
        while not done.is_set():
            data = out.read_bytes()
            seen.add(models.index(data)) if data in models else torn.append(len(data))

    reader = threading.Thread(target=read)
    reader.start()
    try:
        for turn in range(4):
            converts = [subprocess.Popen([binary, "convert", files.bundle, "--precision", precisions[(turn + i) % 3],
                                          "-o", out], stderr=subprocess.PIPE) for i in range(8)]
            for convert in converts:
                assert convert.wait() == 0, convert.stderr.read()
    finally:
        done.set()
        reader.join()
    assert torn == []
    assert len(seen) >= 2, "no replacement was seen"
    assert leftovers(tmp_path, {out.name}) == []


def test_paths_that_are_no_utf8(binary, files, tmp_path):
    """Names are bytes: read, written and told (with a mark for what is no text) whatever they are."""
    folder = os.fsencode(tmp_path) + b"/gar\xe7on \xff\xfe"
    os.mkdir(folder)
    bundle, walk, model = (folder + b"/\xe9" + name for name in (b".safetensors", b"t\xe9.safetensors", b".dcloth"))
    shutil.copy(files.bundle, bundle)
    shutil.copy(files.walk, walk)

    def call(*arguments):
        result = subprocess.run([os.fsencode(binary), *arguments], capture_output=True, timeout=300)
        assert result.returncode == 0, result.stderr
        return result.stdout.decode("utf-8")  # fails on a byte that was passed through

    said = call(b"convert", bundle, b"-o", model, b"--report", folder + b"/r\xe9port", b"--motion", walk, b"--json")
    assert "dcloth" in said
    open(folder + b"/r\xe9port", encoding="utf-8").read()
    call(b"inspect", model, b"--json")
    call(b"profile", model, walk, b"--json", b"--trace", folder + b"/tr\xe0ce")
    call(b"evaluate", bundle, walk, b"--precision", b"int8", b"--json", b"--html", folder + b"/p\xe2ge.html")
    for name in (b"/\xf4ut.safetensors", b"/\xf4ut.pc2", b"/\xf4ut.html"):
        call(b"run", model, walk, b"-o", folder + name)
    plain = tmp_path / "plain.dcloth"
    subprocess.run([binary, "convert", files.bundle, "-o", plain], check=True)
    with open(model, "rb") as written:
        assert written.read() == plain.read_bytes()
    assert sorted(os.listdir(folder)) == sorted([
        b"\xe9.safetensors", b"\xe9t\xe9.safetensors", b"\xe9.dcloth", b"r\xe9port", b"tr\xe0ce", b"p\xe2ge.html",
        b"\xf4ut.safetensors", b"\xf4ut.pc2", b"\xf4ut.html"])
    missing = subprocess.run([os.fsencode(binary), b"inspect", folder + b"/\xfc"], capture_output=True)
    assert missing.returncode == 2
    missing.stderr.decode("utf-8")
