"""A law of a block: u = -b h', which runs inside of the compiled loop."""

from smo_gym.controllers import Feedback
from smo_gym.kernels.blocks import XHAT, U, at, block, put
from smo_gym.loop import Part, columns


@block
def _act(signals, own, lanes):
    for i in range(lanes):
        put(signals, U, i, -at(own, 0, i) * at(signals, XHAT + 2, i))


class Damping(Feedback):
    """Brakes the cart with 5 N s/m, wherever it is."""

    def part(self, n):
        return Part(columns(n, 5.0), act=_act)
