"""Pictures: loss curves of a training run, errors of an evaluation."""


def _axes(columns, size):
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot
    return pyplot, pyplot.subplots(1, columns, figsize=size, squeeze=False)


def curves(histories, path):
    """One panel a stage: training loss and validation error in millimetres over the epochs."""
    pyplot, (figure, axes) = _axes(len(histories), (3.4 * len(histories), 2.8))
    for axis, (stage, history) in zip(axes[0], histories.items()):
        trained = [h for h in history if "training_mm" in h]
        axis.plot([h["epoch"] for h in trained], [h["training_mm"] for h in trained],
                  label="training")
        axis.plot([h["epoch"] for h in history], [h["validation_mm"] for h in history],
                  label="validation")
        axis.set(title=stage, xlabel="epoch", ylim=(0, None))
        axis.grid(alpha=0.3)
    axes[0][0].set_ylabel("mean vertex distance, mm")
    axes[0][0].legend()
    figure.tight_layout()
    figure.savefig(path, dpi=80)
    pyplot.close(figure)


def bars(table, path):
    """table {clip: {level: mm}} as grouped bars."""
    pyplot, (figure, axes) = _axes(1, (9, 3.6))
    axis, levels = axes[0][0], list(next(iter(table.values())))
    width = 0.8 / len(levels)
    for index, level in enumerate(levels):
        axis.bar([i + index * width for i in range(len(table))],
                 [table[clip][level] for clip in table], width, label=level)
    axis.set_xticks([i + 0.4 - width / 2 for i in range(len(table))])
    axis.set_xticklabels([clip.split("/")[-1] for clip in table])
    axis.set_ylabel("$E_d$, mm (held out)")
    axis.grid(axis="y", alpha=0.3)
    axis.legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(path, dpi=80)
    pyplot.close(figure)


def levels(rows, path):
    """rows [(level, milliseconds, millimetres)], the first at the bottom: two panels of bars side by side."""
    pyplot, (figure, axes) = _axes(2, (9, 0.8 + 0.4 * len(rows)))
    for axis, column, label in ((axes[0][0], 1, "a tick and its drawing, ms"), (axes[0][1], 2, "mean error, mm")):
        bars_ = axis.barh([row[0] for row in rows], [row[column] for row in rows])
        axis.bar_label(bars_, fmt="%.2f" if column == 1 else "%.1f", padding=3, fontsize=8)
        axis.set(xlabel=label)
        axis.margins(x=0.15)
        axis.grid(axis="x", alpha=0.3)
    axes[0][1].set_yticklabels([])
    figure.tight_layout()
    pyplot.rcParams["svg.hashsalt"] = "levels"  # the same figures make the same file
    figure.savefig(path, metadata={"Date": None} if str(path).endswith(".svg") else None)
    pyplot.close(figure)
