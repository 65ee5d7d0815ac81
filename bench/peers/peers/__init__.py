"""dcloth and general inference runtimes on the same weights, the same core and the same motion; see run.sh."""
