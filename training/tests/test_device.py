"""--device cuda: refused where there is no GPU; everything that meets on a device is brought there."""
import pytest
import torch
from torch.overrides import TorchFunctionMode

from conftest import SMALL, train_tiny
from dcloth_training import train, train_checks

GPU = torch.device("cuda")


def _tensors(values):
    for value in values:
        if isinstance(value, torch.Tensor):
            yield value
        elif isinstance(value, (list, tuple)):
            yield from _tensors(value)
        elif isinstance(value, dict):
            yield from _tensors(value.values())


def _away(tensor):
    return getattr(tensor, "away", False)


class PretendedGpu(TorchFunctionMode):
    """Computes on the CPU, but keeps a tensor's device apart: tensors of two devices may not meet, as on a real GPU.

    Tensors without dimensions may meet any, and so may indices; numpy takes none from the GPU.
    """

    def __init__(self, monkeypatch):
        super().__init__()
        self.brought, plain = 0, torch.Tensor.__getitem__

        def item(tensor, index):        # PyTorch 1.13 does not tell a mode of indexing
            out = plain(tensor, index)
            out.away = _away(tensor)
            return out
        monkeypatch.setattr(torch.Tensor, "__getitem__", item)

    def __torch_function__(self, func, types, args=(), kwargs=None):
        kwargs = dict(kwargs or {})
        name, own = getattr(func, "__name__", ""), args[0] if args and isinstance(args[0], torch.Tensor) else None
        if func is torch.Tensor.to:
            targets = [a for a in (*args[1:], *kwargs.values()) if isinstance(a, (torch.Tensor, torch.device, str))]
            rest = [a for a in (*args[1:], *kwargs.values()) if isinstance(a, torch.dtype)] + [
                t.dtype for t in targets if isinstance(t, torch.Tensor)]
            out = func(own, *rest[:1]) if rest else func(own, own.dtype)
            away = _away(own)
            for target in targets:
                away = _away(target) if isinstance(target, torch.Tensor) else torch.device(target).type == "cuda"
            if away != _away(own):
                out = out.clone() if out is own else out
                self.brought += away
            out.away = away
            return out
        if func is torch.Tensor.cpu:
            out = own.clone() if _away(own) else own
            out.away = False
            return out
        if func is torch.Tensor.numpy or func is torch.Tensor.__array__:
            assert not _away(own), "numpy asked for a tensor on the GPU"
            return func(*args, **kwargs)
        if func == torch.Tensor.device.__get__:
            return GPU if _away(own) else torch.device("cpu")
        met = [t for t in _tensors((args, kwargs)) if t.dim()]
        may_cross = (torch.Tensor.copy_, torch.Tensor.data.__set__)
        if name != "item" and func not in may_cross and "shallow_copy" not in name:
            where = [(tuple(t.shape), _away(t)) for t in met]
            assert len({away for _, away in where}) < 2, f"{name}: tensors of two devices {where}"
        asked = kwargs.get("device")
        if asked is not None and torch.device(asked).type == "cuda":
            kwargs["device"] = "cpu"
        out = func(*args, **kwargs)
        away = any(map(_away, _tensors((args, kwargs)))) or (asked is not None and torch.device(asked).type == "cuda")
        if func == torch.Tensor.data.__set__:
            own.away = _away(args[1])
        elif func is torch.Tensor.copy_:
            own.away = _away(own)
        elif away:
            for tensor in _tensors((out,)):
                tensor.away = True
        return out


def test_a_gpu_that_is_not_there_is_refused(capsys, monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(SystemExit):
        train.arguments(["--data", "d", "--out", "o", "--device", "cuda"])
    assert "--device cuda" in capsys.readouterr().err


@pytest.mark.parametrize("shards, base", [("1", "learned"), ("2", "learned"), ("1", "rigid")])
def test_all_stages_meet_their_data_on_the_device(tiny, tmp_path, monkeypatch, shards, base):
    monkeypatch.setattr(train_checks, "device", lambda options, refuse: None)
    short = [option if option not in ("10", "20") else "2" for option in SMALL]
    options = train.arguments(["--data", str(tiny), "--out", str(tmp_path / "run"), *short, "--settle-epochs", "1",
                               "--validate-every", "1", "--device", "cuda", "--shards", shards, "--static-base", base])
    with PretendedGpu(monkeypatch) as gpu:
        net = train.run(options)[0]
    assert gpu.brought > 100 and not any(_away(p) for p in net.parameters())


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA GPU")
def test_a_gpu_learns_what_the_cpu_learns(tiny, trained, tmp_path):
    net = train_tiny(tiny, tmp_path / "gpu", "--device", "cuda")[0]
    for name, value in net.state_dict().items():
        assert value.device.type == "cpu" and torch.isfinite(value.float()).all(), name
