"""The three stages of the network, one module each; NETWORK.md gives the formulas."""
