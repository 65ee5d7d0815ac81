"""The paper's ablation (Fig. 11) and comparison (Table 3) on our data, by one command.

    python3 -m dcloth_training.compare --data DIR --full TRAINED --out DIR

Ours and its ablations come from train.py; the other families are re-implemented here from their
papers' ideas, one file each, on the same clips, features, noise, loss and optimiser.
"""
