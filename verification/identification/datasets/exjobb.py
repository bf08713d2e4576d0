"""ExjobbROV: a BlueROV (1) with six thrusters in a pool, Linköping, May 2016 (MrEkelund/ExjobbROV).

All ten bags of May that are here are used: those of March and April have other units. The geometry, the mass and the
volume are those of `initROVParameters.m`. The moments of inertia are guesses, which only their sum with the added ones
would show. The thrust is that of `thrusterLookup.m`, a table of the T200.
"""

from verification.identification.data import Recorded

_ROV = """
[vehicle]
name = "BlueROV 1"
identifier = "bluerov1"
version = "1.0"
description = "A BlueROV with six thrusters"
source = "MrEkelund/ExjobbROV"

[body]
m_rov = { value = 6.621, unit = "kg", source = "initROVParameters.m" }
I_p = { value = 0.1, unit = "kg.m2", source = "a guess" }
I_q = { value = 0.1, unit = "kg.m2", source = "a guess" }
I_r = { value = 0.12, unit = "kg.m2", source = "a guess" }
W = { value = 65.0, unit = "N", source = "the mass" }
B = { value = 65.5, unit = "N", source = "a guess: slightly buoyant" }
z_B = { value = -0.05, unit = "m", source = "initROVParameters.m" }
coupling = true

[curves.t200]

[[thruster]]
name = "1"
curve = "t200"
direction = { value = [0, 0, -1], source = "initROVParameters.m" }
position = { value = [0.16, -0.11, 0], unit = "m", source = "initROVParameters.m" }

[[thruster]]
name = "2"
curve = "t200"
direction = { value = [0, 0, -1], source = "initROVParameters.m" }
position = { value = [0.16, 0.11, 0], unit = "m", source = "initROVParameters.m" }

[[thruster]]
name = "3"
curve = "t200"
direction = { value = [1, 0, 0], source = "initROVParameters.m" }
position = { value = [0, -0.11, 0], unit = "m", source = "initROVParameters.m" }

[[thruster]]
name = "4"
curve = "t200"
direction = { value = [1, 0, 0], source = "initROVParameters.m" }
position = { value = [0, 0.11, 0], unit = "m", source = "initROVParameters.m" }

[[thruster]]
name = "5"
curve = "t200"
direction = { value = [0, 0, -1], source = "initROVParameters.m" }
position = { value = [-0.2, 0, 0], unit = "m", source = "initROVParameters.m" }

[[thruster]]
name = "6"
curve = "t200"
direction = { value = [0, -1, 0], source = "initROVParameters.m" }
position = { value = [0, 0, 0.11], unit = "m", source = "initROVParameters.m" }

[axes.heave]
[axes.roll]
[axes.pitch]
[axes.yaw]

[topics]
"sensor_fusion/states.data[0]" = "roll angle [rad]"
"sensor_fusion/states.data[1]" = "pitch angle [rad]"
"sensor_fusion/states.data[2]" = "heading [rad]"
"sensor_fusion/states.data[3]" = "roll velocity [rad/s]"
"sensor_fusion/states.data[4]" = "pitch velocity [rad/s]"
"sensor_fusion/states.data[5]" = "yaw velocity [rad/s]"
"sensor_fusion/states.data[9]" = "depth [m]"
"""
_THRUST = """command [1],force [kgf]
-1.0,-4.0823
-0.9,-3.7331
-0.8,-3.1842
-0.7,-2.7079
-0.6,-2.1772
-0.5,-1.6420
-0.4,-1.1204
-0.3,-0.6940
-0.2,-0.3538
-0.15,-0.1905
-0.1,-0.0544
-0.05,0
0.05,0
0.1,0.1134
0.15,0.2631
0.2,0.4173
0.3,0.8437
0.4,1.3925
0.5,1.9595
0.6,2.5220
0.7,3.1933
0.8,3.7784
0.9,4.3772
1.0,5.0938
"""
_BAGS = {
    "sinPA1F05_2016-05-25-08-24-36": "f3779bc68f4e4db46d1473da4b91f96be9033e79c32bfb3366e2d3b04d359fba",
    "sinRA1F05_2016-05-25-08-30-43": "dca76de9ce16e97a69d673f325da875fb21f6a9917f2d49ea3894191526460d0",
    "stepRS3E10_2016-05-25-08-32-35": "65dd60a9ccbb2750284cf8e26fce89e93d4af81659570829c7d967743731deac",
    "stepRS3E10_2016-05-25-08-33-30": "f580ed476bfbf6bd8f47c271461e6a5d37a8fb06f3c98ef4305cddb97055816b",
    "sinAllA1F05_2016-05-25-08-37-44": "41be67b49bb9aaf371b0be99c6f7b7474dd17c82373ee7ec77783652e374f20e",
    "stepPhiS3E10_2016-05-25-08-52-08": "fc99ee0a388c4857ff248968b2b1b6d02aa7a486d5dfb56a91ace5c43059aa2e",
    "stepThetaS3E10_2016-05-25-08-57-15": "5c9beb6a48315b5593b470593e120ecb1e732e26c500e44110126b8ad4abfa77",
    "stepPsiS3E10_2016-05-25-09-02-58": "65be62fe9c0faf09673e8efd8fcea108bffbdc4d6cfb75854e38f6fca4f0f5a0",
    "ExactLin_2016-05-25-09-17-38": "e649373769093bd7ecf24b0e0f9b49cb362c82b237679da89b24e9109cce6bd1",
    "stepDepth_2016-05-25-09-34-20": "3815ab9efdd06c6b3dcaae2da075d39b7ddaaf78a756584016094598a7500a2c",
}

EXJOBB = Recorded(
    name="exjobb",
    origin="MrEkelund/ExjobbROV, simulink/Estimation/bag",
    rov=_ROV,
    recordings={name: {f"{name}.bag": digest} for name, digest in _BAGS.items()},
    tables={"thrust_t200.csv": _THRUST},
)
