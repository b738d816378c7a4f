"""The network that every style begins from: what all paintings share is learnt already.

The files beside this one were made by `styletrf.base_network_training`, which says how.
"""

from pathlib import Path

from styletrf.finiteness import load_finite
from styletrf.style_network import StyleNetwork, StyleNetworkConfig

BASE_NETWORKS = {
    StyleNetworkConfig(24, 3): Path(__file__).with_name("base_network_compact.safetensors"),
}
"""Files by the size of their network; 16 bits a weight."""


def base_network(config: StyleNetworkConfig) -> StyleNetwork | None:
    """Returns the base network of a size, or None where there is none."""
    if config not in BASE_NETWORKS:
        return None
    network = StyleNetwork(config)
    stored = load_finite(BASE_NETWORKS[config])
    network.load_state_dict({name: value.float() for name, value in stored.items()})
    return network
