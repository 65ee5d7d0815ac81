"""Residuals in files: the same as in memory, private, and never those of another static stage."""
import os

import numpy as np
import torch

from dcloth_training import dataset, rig


def clips_of(tiny):
    character = rig.read_character(str(tiny / "character.safetensors"))
    fitted = rig.fit(character)
    return character, dataset.load(dataset.find(str(tiny), "dynamic", dataset.HELD_OUT), fitted.rig, character)


def files_in(folder):
    return sorted(os.path.join(where, n) for where, _, names in os.walk(folder) for n in names)


def test_files_hold_what_memory_would(tiny, trained, tmp_path):
    net, folder = trained[0][0], str(tmp_path / "unskinned")
    character, clips = clips_of(tiny)
    dataset.add_residuals(clips, net.static, net.standardise, character)
    _, mapped = clips_of(tiny)
    dataset.add_residuals(mapped, net.static, net.standardise, character, folder)
    assert len(files_in(folder)) == len(clips) > 0
    for one, other in zip(clips, mapped):
        assert np.array_equal(one.residual, other.residual) and one.residual.dtype == other.residual.dtype
    mapped[0].residual[:] = 7                      # stage 3 takes stage 2 off in place
    _, again = clips_of(tiny)
    written = os.stat(files_in(folder)[0]).st_mtime_ns
    dataset.add_residuals(again, net.static, net.standardise, character, folder)
    assert np.array_equal(again[0].residual, clips[0].residual)
    assert os.stat(files_in(folder)[0]).st_mtime_ns == written    # found, not made again


def test_another_static_stage_or_truth_finds_no_file(tiny, trained, tmp_path):
    net, folder = trained[0][0], str(tmp_path / "unskinned")
    character, clips = clips_of(tiny)
    dataset.add_residuals(clips, net.static, net.standardise, character, folder)
    before = files_in(folder)
    own = net.static.mlp[0].bias.detach().clone()      # other tests compare the shared network's bits
    with torch.no_grad():
        net.static.mlp[0].bias += 0.5
    try:
        _, other = clips_of(tiny)
        dataset.add_residuals(other, net.static, net.standardise, character, folder)
    finally:
        with torch.no_grad():
            net.static.mlp[0].bias.copy_(own)
    after = files_in(folder)
    assert len(after) == len(before) and not set(after) & set(before)
    assert not np.array_equal(other[0].residual, clips[0].residual)
