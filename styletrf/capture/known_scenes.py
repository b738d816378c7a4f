"""The public scenes everybody tries first, and the published archives that hold them."""

_LLFF = frozenset(["fern", "flower", "fortress", "horns", "leaves", "orchids", "room", "trex"])
_NERF_SYNTHETIC = frozenset(
    ["chair", "drums", "ficus", "hotdog", "lego", "materials", "mic", "ship"]
)


def download_instructions(name: str) -> str | None:
    """Returns which published archive holds a scene and where to unpack it; None if unknown.

    The LLFF scenes (Mildenhall et al. 2019) and the synthetic ones (Mildenhall et al. 2020) are
    part of the data that the NeRF authors published.
    """
    if name in _LLFF:
        return (
            f"It is one of the LLFF scenes: in nerf_llff_data.zip of the NeRF authors' published "
            f"data, unpack nerf_llff_data/{name}/images (or images_4, images_8: smaller) as "
            f"scenes/{name}/images"
        )
    if name in _NERF_SYNTHETIC:
        return (
            f"It is one of the NeRF-synthetic scenes: in nerf_synthetic.zip of the NeRF authors' "
            f"published data, unpack nerf_synthetic/{name}/train as scenes/{name}/images"
        )
    return None
