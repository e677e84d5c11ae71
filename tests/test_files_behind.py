"""What a file refers to belongs to it: studies and benchmarks notice when it changes."""

import numpy as np
import pytest
from onnx import TensorProto, helper, numpy_helper, save_model
from PIL import Image as Pillow

from servo.bench.contestant import Contestant, Division
from servo.mistake import Mistake
from servo.scenario.named_files import digest_of
from servo.study.parse import load
from servo.study.store import StudyFile, opened
from servo.study.suites import suite
from sim.files.behind import files_behind

WEIGHTS = np.zeros((6, 6), np.float32)


def names(path):
    return sorted(str(file.relative_to(path.parent)) for file in files_behind(path))


def written(folder, **texts):
    for name, text in texts.items():
        path = folder / name.replace("__", "/").replace("_", ".")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


def weights_in_a_branch(name):
    """A graph whose weights are a constant in a branch, and not among its own."""
    tensor = numpy_helper.from_array(WEIGHTS, f"{name}_w")
    constant = helper.make_node("Constant", [], [name], value=tensor)
    return helper.make_graph([constant], name, [], [value(name)])


def value(name):
    return helper.make_tensor_value_info(name, TensorProto.FLOAT, [6, 6])


def network(path, *, in_branches=False, **options):
    """Write a network as torch does by default: its weights lie beside it."""
    if in_branches:
        branches = {f"{k}_branch": weights_in_a_branch(k) for k in ("then", "else")}
        nodes = [helper.make_node("If", ["which"], ["twist"], **branches)]
        given = [helper.make_tensor_value_info("which", TensorProto.BOOL, [])]
        graph = helper.make_graph(nodes, "g", given, [value("twist")])
    else:
        node = helper.make_node("MatMul", ["joints", "w"], ["twist"])
        whole = numpy_helper.from_array(WEIGHTS, "w")
        graph = helper.make_graph([node], "g", [value("joints")], [value("twist")], [whole])
    more = {"save_as_external_data": True, "size_threshold": 0, "convert_attribute": True}
    save_model(helper.make_model(graph), path, **more, **options)


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({"location": "policy.onnx.data"}, ["policy.onnx.data"]),
        ({"location": "ä b.bin"}, ["ä b.bin"]),
        ({"location": "n" * 200}, ["n" * 200]),  # its length takes two bytes
        ({"all_tensors_to_one_file": False}, ["w"]),
        ({"location": "x.data", "in_branches": True}, ["x.data"]),
        ({"all_tensors_to_one_file": False, "in_branches": True}, ["else_w", "then_w"]),
    ],
)
def test_the_weights_of_a_network_belong_to_it(tmp_path, options, expected):
    path = tmp_path / "policy.onnx"
    network(path, **options)
    assert names(path) == sorted(["policy.onnx", *expected])
    before = digest_of(str(path))
    data = tmp_path / expected[0]
    data.write_bytes(b"\1" + data.read_bytes()[1:])
    assert digest_of(str(path)) != before


def test_a_network_whose_entry_is_cut_off_has_what_is_there(tmp_path):
    path = tmp_path / "cut.onnx"
    for end in (b"", b"\xff\xff\xff\xff\xff", b"\x7fdata", b"\x03\0\0\0"):
        path.write_bytes(b"\n\x08location\x12" + end)
        assert names(path) == ["cut.onnx"]


def test_a_mesh_has_its_materials_and_their_pictures(tmp_path):
    texts = {
        "two_obj": "mtllib two.mtl my other.mtl\nv 0 0 0\n",
        "two_mtl": "newmtl a\nKd 1 0 0\nmap_Kd -s 1 1 1 pictures\\wood grain.png\nbump b.png\n",
        "my other_mtl": "newmtl b\nmap_Ks c.png\n",
        "pictures__wood grain_png": "",
        "b_png": "",
        "c_png": "",
        "other_png": "",
    }
    written(tmp_path, **texts)
    found = names(tmp_path / "two.obj")
    assert found == [
        "b.png",
        "c.png",
        "my other.mtl",
        "pictures/wood grain.png",
        "two.mtl",
        "two.obj",
    ]


MJCF = """<mujoco><compiler meshdir="m" texturedir="t"/><include file="parts/more.xml"/>
<asset><model name="sub" file="sub/sub.xml"/><mesh name="a" file="a.obj"/>
<texture type="cube" fileup="up.png" filedown="gone.png"/><hfield file="h.png" size="1 1 1 1"/>
<skin file="s.skn"/></asset></mujoco>"""


def test_a_model_has_its_meshes_pictures_and_models_and_what_is_behind_these(tmp_path):
    texts = {
        "robot_xml": MJCF,
        "parts__more_xml": '<mujoco><asset><mesh file="/gone/m.stl"/></asset></mujoco>',
        "sub__sub_xml": '<mujoco><compiler assetdir="z"/><asset><mesh file="b.stl"/></asset></mujoco>',
        "m__a_obj": "mtllib a.mtl\n",
        "m__a_mtl": "newmtl a\nmap_Kd a.png\n",
        "m__a_png": "",
        "t__up_png": "",
        "h_png": "",
        "s_skn": "",
        "sub__z__b_stl": "",
        "m__m_stl": "",  # where strippath="true" has it looked for
        "m__other_stl": "",
    }
    written(tmp_path, **texts)
    known = {"m__other_stl"}
    found = names(tmp_path / "robot.xml")
    assert found == sorted(n.replace("__", "/").replace("_", ".") for n in {*texts} - known)


URDF = """<robot name="r"><link name="l"><visual><geometry>
<mesh filename="package://arm_description/meshes/l.dae"/></geometry>
<material name="m"><texture filename="package://arm_description/t.png"/></material></visual>
<collision><geometry><mesh filename="package://other/l.stl"/></geometry></collision></link></robot>
"""
COLLADA = """<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema"><library_images>
<image id="i"><init_from>../skin.png</init_from></image></library_images></COLLADA>"""


def test_a_urdf_has_what_it_takes_from_its_package_and_from_those_beside(tmp_path):
    own = tmp_path / "src" / "arm_description"
    written(
        own,
        urdf__arm_urdf=URDF,
        meshes__l_dae=COLLADA,
        skin_png="",
        t_png="",
        package_xml="<package/>",
    )
    written(tmp_path / "src", other__l_stl="", other__m_stl="")
    found = {str(f.relative_to(tmp_path / "src")) for f in files_behind(own / "urdf/arm.urdf")}
    assert found == {
        "arm_description/urdf/arm.urdf",
        "arm_description/package.xml",
        "arm_description/meshes/l.dae",
        "arm_description/skin.png",
        "arm_description/t.png",
        "other/l.stl",
    }


ONE_NAME = {
    "C:\\ is not here": ("a.obj", "mtllib C:\\proj\\two.mtl", "two.mtl"),
    "an absolute path": ("a.obj", "mtllib /elsewhere/u/two.mtl", "two.mtl"),
    "moved": ("a.obj", "mtllib mats/two.mtl", "two.mtl"),
    "a byte order mark": ("a.obj", "\ufeffmtllib two.mtl", "two.mtl"),
    "a picture that moved": ("a.mtl", "map_Kd D:\\x\\c.png", "c.png"),
    "Collada": ("a.dae", "<C><init_from>./a%20b.png</init_from></C>", "a b.png"),
    "Collada 1.5": ("a.dae", '<C xmlns="c"><init_from><ref>b.png</ref></init_from></C>', "b.png"),
    "glTF": ("a.gltf", '{"images": [{"uri": "a%20b.png"}]}', "a b.png"),
    "a name with a percent sign": ("a.urdf", '<robot><mesh filename="a%20b"/></robot>', "a%20b"),
    "another suffix": ("a.mjcf", '<mujoco><mesh file="b.stl"/></mujoco>', "b.stl"),
    "no suffix": ("a", '\ufeff<?xml version="1.0"?>\n<mujoco><mesh file="b"/></mujoco>', "b"),
}


@pytest.mark.parametrize("case", ONE_NAME)
def test_a_file_changes_with_one_that_it_names(tmp_path, case):
    name, text, behind = ONE_NAME[case]
    (tmp_path / name).write_text(text, "utf-8")
    (tmp_path / behind).write_text("one")
    before = digest_of(str(tmp_path / name))
    (tmp_path / behind).write_text("another")
    assert digest_of(str(tmp_path / name)) != before


@pytest.mark.parametrize("name", ["mine.xml", "mine.urdf", "mine.obj", "mine.mtl", "mine.onnx"])
@pytest.mark.parametrize("content", [b"", b"<mujoco", b"\xff\0\n\n", b"<?xml encoding='x'?><a/>"])
def test_behind_a_damaged_file_is_nothing(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    assert names(tmp_path / name) == [name]


def test_files_that_name_each_other_are_found_once(tmp_path):
    both = {"a_xml": "b.xml", "b_xml": "a.xml"}
    written(tmp_path, **{k: f'<mujoco><include file="{v}"/></mujoco>' for k, v in both.items()})
    assert names(tmp_path / "a.xml") == ["a.xml", "b.xml"]


STUDY = """scenario = "still"
axes = {"run.latency" = [0, 1]}
set = {"controller.kind" = "onnx", "controller.file" = "policy.onnx", "estimator.kind" = "none"}
"""


@pytest.fixture
def policy(tmp_path, monkeypatch):
    """A network with its weights beside it, in the working directory."""
    monkeypatch.chdir(tmp_path)
    network("policy.onnx", location="policy.onnx.data")
    return tmp_path / "policy.onnx.data"


def test_a_study_does_not_go_on_with_other_weights(policy):
    (policy.parent / "study.toml").write_text(STUDY)

    def begin():
        with opened(policy.parent / "out", StudyFile.of(load("study.toml"), "")):
            pass

    begin()
    begin()
    policy.write_bytes(b"\1" + policy.read_bytes()[1:])
    with pytest.raises(Mistake, match=r"holds another study \(its files differ: \S*policy.onnx\)"):
        begin()


@pytest.mark.parametrize(
    "settings",
    [
        {"controller.kind": "onnx", "controller.file": "policy.onnx"},
        {"tracker.kind": "trax", "tracker.command": 'python -m my model="policy.onnx"'},
        {"tracker.kind": "opencv", "tracker.name": "Nano", "tracker.model": ["policy.onnx", "b"]},
    ],
)
def test_a_contestant_is_another_one_with_other_weights(policy, settings):
    one = Contestant("mine", settings, Division.OPEN)
    before = one.digest
    policy.write_bytes(b"\1" + policy.read_bytes()[1:])
    assert one.digest != before


@pytest.mark.parametrize("changed", ["0002.png", "groundtruth.txt"])
def test_a_recorded_sequence_is_another_one_with_other_pictures_or_truth(tmp_path, changed):
    folder = tmp_path / "mine"
    folder.mkdir()
    for number in range(3):
        Pillow.fromarray(np.full((48, 64, 3), number, np.uint8)).save(folder / f"{number:04}.png")
    (folder / "groundtruth.txt").write_text("5,5,20,15\n" * 3)

    def described():
        ((entry,), _) = suite(str(folder))
        return entry.describe()

    before = described()
    assert described() == before
    if changed == "groundtruth.txt":
        (folder / changed).write_text("5,5,20,15\n" * 2 + "6,5,20,15\n")
    else:
        Pillow.fromarray(np.full((48, 64, 3), 9, np.uint8)).save(folder / changed)
    assert described() != before
