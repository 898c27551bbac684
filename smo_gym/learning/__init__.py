"""Learning on estimated state, and the contest of what was learned with what was designed.

``settings.py`` says what a training is, ``sb3.py`` puts the vector environments into Stable-Baselines3, ``training.py``
trains. Only these two need the extra ``rl``.
"""
