"""Everybody who takes part, and why the others do not."""
import importlib
import json
import os
import subprocess

from .engine_peer import EnginePeer

# Name -> module, class, arguments. ONNX Runtime's float32 is what ratios are to.
PEERS = {"ONNX Runtime fp32": ("onnxruntime_peer", "OnnxRuntimePeer", {}),
         "ONNX Runtime int8": ("onnxruntime_peer", "OnnxRuntimePeer", {"int8": True}),
         "OpenVINO fp32": ("openvino_peer", "OpenVinoPeer", {}),
         "LiteRT fp32": ("litert_peer", "LiteRtPeer", {}),
         "LiteRT int8": ("litert_peer", "LiteRtPeer", {"int8": True}),
         "PyTorch fp32": ("torch_peer", "TorchPeer", {}),
         "ncnn fp32": ("ncnn_peer", "NcnnPeer", {})}
BASELINE = "ONNX Runtime fp32"
BASELINE_INT8 = "ONNX Runtime int8"
PRECISIONS = ("fp32", "fp16", "int8")
# What the converter is asked for, row by row. Of the seeded garment as many rows of the basis as the peers' has, or as
# few as its numerical rank, which is exact but for rounding; of the trained one what it does unasked, which is that
# too, then with all rows, and without the stage that this garment does without.
SEEDED = [(f"dcloth {precision}{suffix}", precision, ("--rank", rank))
          for suffix, rank in (("", "full"), (", exact rank", "exact")) for precision in PRECISIONS]
TRAINED = [(f"dcloth {precision}", precision, ()) for precision in PRECISIONS]
TRAINED += [("dcloth int8, whole basis", "int8", ("--rank", "full")),
            ("dcloth int8, two stages", "int8", ("--stages", "skeleton"))]


def engines(library, convert, bundle, sequence, folder, models):
    """{name: EnginePeer} of models converted here and now."""
    made = {}
    for name, precision, asked in models:
        path = os.path.join(folder, f"{len(made)}.dcloth")
        command = [convert, "convert", bundle, "-o", path, "--precision", precision, "--json", *asked]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise RuntimeError(f"{' '.join(command)}: exit {done.returncode}\n{done.stderr}")
        made[name] = EnginePeer(library, path, sequence, precision, json.loads(done.stdout)["basis"]["rank"])
    return made


def peers(case, folder, say):
    """({name: peer}, {name: why it is absent})."""
    made, absent = {}, {}
    for name, (module, kind, arguments) in PEERS.items():
        say(f"{name}: trying its graphs")
        try:
            made[name] = getattr(importlib.import_module(f".{module}", __package__), kind)(case, folder, **arguments)
        except Exception as error:    # not installed, or refuses the graphs: said in the page, the others go on
            absent[name] = f"{type(error).__name__}: {error}".splitlines()[0][:300]
    return made, absent
