"""TAUV: an AUV in a pool, Carnegie Mellon, December 2022 (Tartan-AUV/TAUV-Playground).

The commands are a wrench, so that there is one thruster for each force and a pair for the torque. The frames, the
estimator behind the velocities and the allocation to the real thrusters are not documented. The mass is the one that
`model_identification.m` there takes, and the moment of inertia its start; the rates in the files are 0.
"""

from verification.identification.data import Recorded

_HEAD = """
[vehicle]
name = "TAUV"
identifier = "tauv"
version = "1.0"
description = "An AUV with eight thrusters"
source = "Tartan-AUV/TAUV-Playground"

[body]
m_rov = { value = 30.0, unit = "kg", source = "model_identification.m" }
I_r = { value = 1.0, unit = "kg.m2", source = "model_identification.m" }
coupling = true

[inputs]
forcex = { forcex = 1 }
forcey = { forcey = 1 }
forcez = { forcez = 1 }
torquez = { na = 1, nb = 1 }

[axes.surge]
[axes.sway]
[axes.heave]
[axes.yaw]

[columns]
"%time" = "time [ns]"
"field.position.z" = "depth [m]"
"field.velocity.x" = "surge velocity [m/s]"
"field.velocity.y" = "sway velocity [m/s]"
"field.velocity.z" = "heave velocity [m/s]"
"field.orientation.x" = "roll angle [rad]"
"field.orientation.y" = "pitch angle [rad]"
"field.orientation.z" = "heading [rad]"
"field.force.x" = "u_forcex [N 30]"
"field.force.y" = "u_forcey [N 30]"
"field.force.z" = "u_forcez [N 30]"
"field.torque.z" = "u_torquez [N.m 20]"
"""
_CURVE = """
[curves.{name}]
a_t = {{ value = 0.0, unit = "N", source = "a wrench" }}
b_t = {{ value = {full}, unit = "N", source = "a wrench" }}
"""
_THRUSTER = """
[[thruster]]
name = "{name}"
curve = "{curve}"
direction = {{ value = {direction}, source = "a wrench" }}
position = {{ value = {position}, unit = "m", source = "a wrench" }}
"""
_ROV = (
    _HEAD
    + "".join(_CURVE.format(name=name, full=full) for name, full in zip("xyzn", (30.0, 30.0, 30.0, 10.0), strict=True))
    + "".join(
        _THRUSTER.format(name=name, curve=curve, direction=direction, position=position)
        for name, curve, direction, position in (
            ("forcex", "x", [1, 0, 0], [0, 0, 0]),
            ("forcey", "y", [0, 1, 0], [0, 0, 0]),
            ("forcez", "z", [0, 0, 1], [0, 0, 0]),
            ("na", "n", [1, 0, 0], [0, -1, 0]),
            ("nb", "n", [-1, 0, 0], [0, 1, 0]),
        )
    )
)
_HASHES = (
    (
        "415586671e0478408ed3be230908719988e62d7d517f814b8cad532af42a984f",
        "978908480b04d48f05ec1df85882bc6c9053d95bbb05395a6a5b2da524481a81",
    ),
    (
        "098874d0230fc671c75f34e7e37d1150d3f41c101187f153d3edc3b2f3b59535",
        "e04fe654967810135a537eadddd45ef947d7b9b2e0c39b12ae6d2d3984294aaf",
    ),
    (
        "bf30d1f4a15e2bd5f8ec926959c2014c955a94b32e47545a9691c390940acf70",
        "497deec2731d5df8231ca44088bdd72fa35735dac8b16602c6512ca9ca3922e7",
    ),
    (
        "9142a99b3b88a76c2f896abf98a15e720a81b7a74f88c454de46b34a65aca805",
        "148e227dde810b9484193971394953918a8bd9322da7b8fc6552ee2983e47b92",
    ),
    (
        "cac4263fdfbfa423b78d3f4d9cb44013b099eebbab538b933a670bffee4a0b87",
        "32a87ddeab0f7c4245953e1f63071c13f4e762201ecac596ac182723e3fcddd7",
    ),
    (
        "1bbb8885b97d7c5ec5ce28de3f728979c8d68f764ea7fadac5c2312faa5c9119",
        "a45aa7e2c06f921d463dc86686c82cbae4114cb8310f0a1e031b6ca8bfa3272c",
    ),
    (
        "616186cab53bf598c68db5f13e3eed2ffbff3e4f733a0034b9b9fbb7ec4f1ced",
        "b5df6344abe08d67a6e6a7dea404347895e1f7afdc7af82b529a7dcfcec45acb",
    ),
    (
        "89647402e28a628cc8af2ba5eae9ddc4a2260dd0cf7f6cc48f04b99d92494ba0",
        "e2b55fbbd97730c079a78c9ebf0080be2d011bc6de22409a7575521f507b192d",
    ),
    (
        "12979ba93b60124d5471615ffaa91e060b48e691da317ed7152b3f471afecad3",
        "52b9e74136e23a03e3217dccf2076d883696b9f54985b0fe8bcaff59dd270971",
    ),
    (
        "da338b94cf1cb59c507c65ac167bf7e76f92733a23e75b4be7ed70d0783c9908",
        "419322dd56a1a679508463eecf169bd6dff59ac757e80ad78792a57cf3b34e32",
    ),
    (
        "f1515e8706f2dc482a0b5bb3bd993564b7b5e35d6b4f3a40db457f508d33c1ba",
        "7fb57ae710a59f6d6d4e6710b3523be8c4dd9f85f892c2f056a464fc00f3a9c8",
    ),
    (
        "fa83b00e334c5d758595ab6d35cb80374e05651f48f25541defa1f9aa615fbeb",
        "0217a1eff1cd3e68d13d04171f6a1b3cd3455fd94c5fed73c9c64f679dbb2287",
    ),
)
"""Of the wrench and of the navigation state of each recording."""

TAUV = Recorded(
    name="tauv",
    origin="Tartan-AUV/TAUV-Playground, model-identification/data/bags-12-01-22",
    rov=_ROV,
    recordings={
        f"d{n}": {f"wrench_{n}.csv": wrench, f"navigation_state_{n}.csv": state}
        for n, (wrench, state) in enumerate(_HASHES)
    },
)
