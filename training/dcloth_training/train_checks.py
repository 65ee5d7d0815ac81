"""What can be known before training of what would end it, or waste it."""
import torch

from . import dataset, fit_mesh, fit_static, stages

def ranges(options, refuse):
    """refuse(text) of the first option that no training or no model takes."""
    of_stages = {name: least for stage in stages.STAGES for name, (_, least, _) in stage.fit.OPTIONS.items()}
    for name, least in {"threads": 1, "validate-every": 1, **of_stages}.items():
        value = getattr(options, name.replace("-", "_"))
        if least is not None and value < least:
            refuse(f"--{name} {value}: at least {least}")
    if options.static_base not in fit_static.BASES:
        refuse(f"--static-base {options.static_base}: allowed are {', '.join(fit_static.BASES)}")
    if options.mesh_width % 8 or options.mesh_width > 64:
        refuse(f"--mesh-width {options.mesh_width}: a multiple of 8 up to 64")
    if options.mesh_layers > 8:
        refuse(f"--mesh-layers {options.mesh_layers}: at most 8")


def device(options, refuse):
    """refuse(text) of a device that PyTorch does not find here."""
    if options.device == "cuda" and not torch.cuda.is_available():
        refuse(f"--device cuda: PyTorch {torch.__version__} finds no CUDA GPU; install its CUDA build and a driver, or "
               "use --device cpu")


def apart(options, refuse):
    """refuse(text) where a clip is to choose the epoch and to be measured on, too."""
    both = set(dataset.clip_names(options.validation)) & set(dataset.clip_names(options.held_out))
    if both:
        refuse(f"--held-out {', '.join(sorted(both))}: also in --validation, which chooses the epoch to keep; name "
               "other clips in one of them")


def lengths(training, options, log):
    """Refuses clips that are all too short for a window of stage 2 or 3, or too few for stage 3's basis; names those
    that stage 2 leaves out."""
    longest = max(map(len, training))
    needs = [("window", options.window)] * (options.stages in ("skeleton", "mesh")) + \
        [("chunk", 2 * options.chunk)] * (options.stages == "mesh" and options.mesh_epochs > 0)
    for name, ticks in needs:
        if longest < ticks:
            raise ValueError(f"{options.data}: no training clip of {ticks} ticks or more (the longest has {longest}); "
                             f"lower --{name} or train on longer clips")
    seen = sum(-(-len(c) // fit_mesh.BASIS_EVERY) for c in training)
    if options.stages == "mesh" and not options.head_data and seen < options.mesh_size:
        raise ValueError(f"{options.data}: {sum(map(len, training))} frames, mirror images counted; --mesh-size "
                         f"{options.mesh_size} wants {fit_mesh.BASIS_EVERY * options.mesh_size}: lower it, train on "
                         f"more, or stop at --stages skeleton")
    short = sorted({f"{c.name} ({len(c)})" for c in training if len(c) < options.window})
    if short and options.stages in ("skeleton", "mesh"):
        log(f"training: {len(short)} clips are shorter than --window {options.window} and not seen by stage 2: "
            f"{', '.join(short[:5])}{', ...' if len(short) > 5 else ''}")
