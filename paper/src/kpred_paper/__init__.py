"""Weights of the model `kp-red`: the architecture and losses of the paper, trained as the cards beside them say."""
