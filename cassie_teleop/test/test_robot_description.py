"""Links, shapes and meshes out of a URDF."""

import math

import pytest

from cassie_teleop.robot_description import DescriptionError, quaternion, read_description

URDF = """
<robot name="r">
  <material name="body"><color rgba="1 0.5 0 1"/></material>
  <link name="left_toe_link">
    <visual><geometry><sphere radius="0.1"/></geometry><material name="body"/></visual>
    <collision><origin xyz="0.1 0 0"/><geometry><sphere radius="0.02"/></geometry></collision>
  </link>
  <link name="base">
    <visual>
      <origin xyz="1 2 3" rpy="0 0 1.5707963267948966"/>
      <geometry><mesh filename="package://some/meshes/a.stl" scale="1 -1 1"/></geometry>
    </visual>
    <visual><geometry><mesh filename="package://some/meshes/missing.stl"/></geometry></visual>
    <visual><geometry><box size="1 2 3"/></geometry></visual>
  </link>
  <link name="imu"/>
  <joint name="left_toe" type="revolute">
    <parent link="base"/><child link="left_toe_link"/><limit effort="45" lower="0" upper="1"/>
  </joint>
  <joint name="imu" type="fixed"><parent link="base"/><child link="imu"/></joint>
</robot>
"""


@pytest.fixture
def share(tmp_path):
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes/a.stl").write_bytes(b"solid")
    (tmp_path / "secret.stl").write_bytes(b"solid")

    def find(package):
        if package != "some":
            raise LookupError(package)
        return str(tmp_path / "meshes" / "..") if package == "up" else str(tmp_path)

    return find


def test_a_robot_is_read_parents_first(share):
    robot = read_description(URDF, share)
    assert [link["name"] for link in robot.links] == ["base", "left_toe_link", "imu"]
    assert robot.moving == ["base", "left_toe_link"]
    assert robot.efforts == {"left_toe": 45.0}
    base, toe, _ = robot.links
    assert [shape["kind"] for shape in base["shapes"]] == ["mesh", "box"]
    mesh = base["shapes"][0]
    assert (mesh["mesh"], mesh["size"]) == (0, [1.0, -1.0, 1.0])
    assert mesh["pose"] == pytest.approx([1, 2, 3, 0, 0, math.sqrt(0.5), math.sqrt(0.5)])
    assert robot.meshes[0].name == "a.stl"
    assert toe["parent"] == "base" and toe["soles"] == [[0.1, 0.0, 0.0, 0.02]]
    assert toe["shapes"][0]["colour"] == [1.0, 0.5, 0.0, 1.0]


@pytest.mark.parametrize(
    "uri",
    [
        "file:///etc/passwd",
        "/etc/passwd.stl",
        "package://some/../other/secret.stl",
        "package://some/meshes/../../secret.stl",
        "package://unknown/a.stl",
        "package:///etc/a.stl",
        "package://some/meshes",
        "http://example.org/a.stl",
    ],
)
def test_only_meshes_inside_a_package_are_served(share, uri):
    urdf = URDF.replace("package://some/meshes/a.stl", uri)
    assert read_description(urdf, share).meshes == []


@pytest.mark.parametrize(
    "text",
    [
        "",
        "no xml",
        "<robot/>",
        "<robot><link/></robot>",
        URDF.replace('rpy="0 0 1.5707963267948966"', 'rpy="0 0"'),
        URDF.replace('rpy="0 0 1.5707963267948966"', 'rpy="0 0 nan"'),
        URDF.replace('<parent link="base"/><child link="imu"/>', '<child link="imu"/>'),
        URDF.replace(
            '<parent link="base"/><child link="imu"/>', '<parent link="x"/><child link="imu"/>'
        ),
        URDF.replace('effort="45"', 'effort="much"'),
        URDF.replace('radius="0.1"', ""),
    ],
)
def test_what_is_no_robot_is_refused_in_words(share, text):
    with pytest.raises(DescriptionError, match="cannot be drawn"):
        read_description(text, share)


def test_quaternions_are_those_of_turns_about_z_y_x():
    assert quaternion(0.0, 0.0, 0.0) == [0.0, 0.0, 0.0, 1.0]
    half = math.sqrt(0.5)
    assert quaternion(math.pi / 2, 0, 0) == pytest.approx([half, 0, 0, half])
    assert quaternion(0, math.pi / 2, 0) == pytest.approx([0, half, 0, half])
    assert quaternion(0, 0, math.pi / 2) == pytest.approx([0, 0, half, half])
    assert quaternion(math.pi / 2, 0, math.pi / 2) == pytest.approx([0.5, 0.5, 0.5, 0.5])
