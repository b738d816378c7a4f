"""Poses of photographs that are stored on their side, or on their heads, and turned by EXIF."""

import json
from itertools import product

import numpy as np
import pycolmap
import pytest
from made_photographs import encoded, png_with_exif, room_poses, texture, tiff_of, with_exif

from styletrf.capture.photographs import read_photograph
from styletrf.capture.poses.given_poses import GivenView, Lens
from styletrf.capture.poses.pose_formats import find_given_poses
from styletrf.capture.poses.upright_views import upright_views

WIDTH, HEIGHT, FOCAL = 60, 40, 50.0
TURNED = (3, 6, 8)
MODELS = sorted(pycolmap.CameraModelId.__members__.keys() - {"INVALID", "EQUIRECTANGULAR"})
USUAL = {"f": FOCAL, "fx": FOCAL, "fy": 46.0, "cx": 33.0, "cy": 18.5, "omega": 0.9, "beta": 1.1}
POSES = room_poses(3)
AHEAD = np.random.default_rng(0).uniform([-0.4, -0.3, 1], [0.4, 0.3, 1], (20, 3))


def lens_of(model):
    names = pycolmap.Camera(model=model, width=WIDTH, height=HEIGHT).params_info.split(", ")
    few = np.random.default_rng(1).uniform(-0.03, 0.03, len(names))
    params = [USUAL.get(name, bend) for name, bend in zip(names, few, strict=True)]
    return Lens(model, tuple(map(float, params)), WIDTH, HEIGHT)


FORMATS = {
    ".jpg": lambda pixels, orientation: with_exif(encoded(pixels), orientation),
    ".png": lambda pixels, orientation: png_with_exif(encoded(pixels, ".png"), orientation),
    ".PNG": lambda pixels, orientation: png_with_exif(
        encoded(pixels, ".png"), orientation, is_behind=True
    ),
    ".tif": tiff_of,
}


def stored_photograph(path, orientation, pixels=None):
    pixels = texture(HEIGHT, WIDTH) if pixels is None else pixels
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(FORMATS[path.suffix](pixels, orientation))
    return path


def projected(view, points_world):
    lens, pose = view.lens, view.world_from_camera
    camera = pycolmap.Camera(
        model=lens.model, width=lens.width, height=lens.height, params=lens.params
    )
    return camera.img_from_cam((points_world - pose[:, 3]) @ pose[:, :3])


def upright_pixels(stored, orientation):
    """EXIF 2.3: where the first row and column of the stored picture belong."""
    x, y = stored.T
    turned = {3: (WIDTH - x, HEIGHT - y), 6: (HEIGHT - y, x), 8: (y, WIDTH - x)}[orientation]
    return np.column_stack(turned)


@pytest.mark.parametrize("orientation", TURNED)
@pytest.mark.parametrize("model", MODELS)
def test_points_move_with_the_pixels_whatever_the_lens(tmp_path, model, orientation):
    view = GivenView(stored_photograph(tmp_path / "a.jpg", orientation), lens_of(model), POSES[0])
    points = AHEAD @ POSES[0][:, :3].T + POSES[0][:, 3]
    (upright,) = upright_views([view], are_stored=True)
    expected = upright_pixels(projected(view, points), orientation)
    np.testing.assert_allclose(projected(upright, points), expected, atol=1e-6)


@pytest.mark.parametrize("orientation", TURNED)
@pytest.mark.parametrize(
    ("suffix", "channels"), [(".jpg", 3), *product((".png", ".PNG", ".tif"), (3, 4))]
)
def test_a_point_is_where_the_upright_photograph_shows_it(tmp_path, orientation, suffix, channels):
    view = GivenView(tmp_path / f"a{suffix}", lens_of("OPENCV"), POSES[0])
    point = AHEAD[:1] @ POSES[0][:, :3].T + POSES[0][:, 3]
    ((x, y),) = projected(view, point)
    dark = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    dark[int(y) - 1 : int(y) + 2, int(x) - 1 : int(x) + 2] = 255
    opaque = np.full((HEIGHT, WIDTH), 255, np.uint8)
    stored_photograph(view.file, orientation, np.dstack([dark, opaque][: channels - 2]))
    photograph = read_photograph(view.file)
    (upright,) = upright_views([view], are_stored=True)
    assert photograph.shape[:2] == (upright.lens.height, upright.lens.width)
    bright = np.argwhere(photograph[..., 0] > 128)[:, ::-1].mean(axis=0) + 0.5
    np.testing.assert_allclose(projected(upright, point)[0], bright, atol=1.0)


def in_its_file(pose, orientation):
    """The pose of the stored picture: its axes along those of the upright one."""
    right, down, ahead, center = pose.T
    x, y = {1: (right, down), 3: (-right, -down), 6: (down, -right), 8: (-down, right)}[orientation]
    return np.column_stack([x, y, ahead, center])


def write_colmap(folder, stored):
    model = pycolmap.Reconstruction()
    params = [FOCAL, FOCAL, WIDTH / 2, HEIGHT / 2]
    lens = pycolmap.Camera(model="PINHOLE", width=WIDTH, height=HEIGHT, params=params, camera_id=1)
    model.add_camera_with_trivial_rig(lens)
    for index, pose in enumerate(stored):
        image = pycolmap.Image(name=f"{index}.jpg", camera_id=1, image_id=index + 1)
        rigid = pycolmap.Rigid3d(pycolmap.Rotation3d(pose[:, :3]), pose[:, 3])
        model.add_image_with_trivial_frame(image, rigid.inverse())
    (folder / "sparse/0").mkdir(parents=True)
    model.write_binary(folder / "sparse/0")


def write_transforms(folder, stored):
    frames = [
        {
            "file_path": f"images/{index}.jpg",
            "transform_matrix": (pose @ np.diag([1, -1, -1, 1])).tolist(),
        }
        for index, pose in enumerate(stored)
    ]
    lens = {"w": WIDTH, "h": HEIGHT, "fl_x": FOCAL}
    (folder / "transforms.json").write_text(json.dumps({**lens, "frames": frames}))


def write_llff(folder, stored):
    rows = []
    for pose in stored:
        right, down, ahead, center = pose.T
        matrix = np.column_stack([down, right, -ahead, center, [HEIGHT, WIDTH, FOCAL]])
        rows.append(np.concatenate([matrix.reshape(-1), [1.0, 10.0]]))
    np.save(folder / "poses_bounds.npy", np.array(rows))


@pytest.mark.parametrize("orientations", [(6, 6, 6), (8, 1, 6), (3, 6, 1)])
@pytest.mark.parametrize("write", [write_colmap, write_transforms, write_llff])
def test_poses_of_stored_pictures_become_those_of_the_upright_photographs(
    tmp_path, write, orientations
):
    """They were rolled by a quarter, and the search for points failed or believed them."""
    for index, orientation in enumerate(orientations):
        stored_photograph(tmp_path / f"images/{index}.jpg", orientation)
    write(tmp_path, list(map(in_its_file, POSES, orientations)))
    found = find_given_poses(tmp_path)
    for view, pose, orientation in zip(found.views, POSES, orientations, strict=True):
        np.testing.assert_allclose(view.world_from_camera, pose, atol=1e-9)
        upright = (WIDTH, HEIGHT) if orientation < 5 else (HEIGHT, WIDTH)
        assert (view.lens.width, view.lens.height) == upright
        assert view.lens.params == (FOCAL, FOCAL, upright[0] / 2, upright[1] / 2)


def test_a_frame_without_a_size_leaves_the_poses_of_the_others_turned(tmp_path):
    """One such frame, and no pose was that of the upright photograph."""
    for index in range(3):
        stored_photograph(tmp_path / f"images/{index}.jpg", 6)
    write_transforms(tmp_path, [in_its_file(pose, 6) for pose in POSES])
    transforms = json.loads((tmp_path / "transforms.json").read_text())
    lens = {name: transforms.pop(name) for name in ("w", "h", "fl_x")}
    for index, frame in enumerate(transforms["frames"]):
        frame.update(lens if index else {"fl_x": FOCAL})
    (tmp_path / "transforms.json").write_text(json.dumps(transforms))
    first, *others = find_given_poses(tmp_path).views
    assert (first.lens.width, first.lens.height) == (HEIGHT, WIDTH)
    for view, pose in zip(others, POSES[1:], strict=True):
        np.testing.assert_allclose(view.world_from_camera, pose, atol=1e-9)
        assert (view.lens.width, view.lens.height) == (HEIGHT, WIDTH)


UPRIGHT_LENS = Lens("PINHOLE", (FOCAL, FOCAL, HEIGHT / 2, WIDTH / 2), HEIGHT, WIDTH)


@pytest.mark.parametrize(
    ("orientation", "lens", "are_stored"),
    [
        (1, lens_of("PINHOLE"), True),
        (3, lens_of("PINHOLE"), False),
        (6, UPRIGHT_LENS, True),
        (2, lens_of("PINHOLE"), True),
        (5, lens_of("PINHOLE"), True),
    ],
    ids=["upright", "nothing says so", "lens of the upright one", "mirrored", "mirrored, lying"],
)
def test_views_are_left_alone_where_they_are_not_of_lying_pictures(
    tmp_path, orientation, lens, are_stored
):
    view = GivenView(stored_photograph(tmp_path / "a.jpg", orientation), lens, POSES[0])
    (found,) = upright_views([view], are_stored=are_stored)
    assert found.lens == lens
    np.testing.assert_array_equal(found.world_from_camera, view.world_from_camera)


@pytest.mark.parametrize(
    ("beside", "is_turned"), [(lens_of("PINHOLE"), True), (UPRIGHT_LENS, False)]
)
@pytest.mark.parametrize("are_stored", [False, True])
def test_a_photograph_on_its_head_is_treated_as_those_that_lie_beside_it(
    tmp_path, beside, is_turned, are_stored
):
    """Its own format does not say whether its pose is that of the stored picture."""
    lying = GivenView(stored_photograph(tmp_path / "a.jpg", 6), beside, POSES[0])
    on_its_head = GivenView(stored_photograph(tmp_path / "b.jpg", 3), lens_of("PINHOLE"), POSES[1])
    for view in upright_views([lying, on_its_head], are_stored=are_stored)[1:]:
        right, down, _ = view.world_from_camera[:, :3].T
        turned = -1 if is_turned else 1
        np.testing.assert_allclose(right, turned * POSES[1][:, 0])
        np.testing.assert_allclose(down, turned * POSES[1][:, 1])
