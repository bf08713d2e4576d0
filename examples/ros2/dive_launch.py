"""Drive an FMU through ROS 2's fmi_adapter: ros2 launch ./dive_launch.py fmu_path:=$PWD/videoray.fmu

`rov-fmu build --interface cs` makes the FMU. The node has a topic of std_msgs/Float64 for each input and each output:

    ros2 topic pub /videoray/u_t std_msgs/msg/Float64 "data: 0.3"
    ros2 topic echo /videoray/z

It needs the packages fmi_adapter and launch_ros of a ROS 2 distribution, which were not run with this file.
"""

import launch
from launch.actions import DeclareLaunchArgument, EmitEvent, RegisterEventHandler
from launch.events import matches_action
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode
from launch_ros.event_handlers import OnStateTransition
from launch_ros.events.lifecycle import ChangeState
from lifecycle_msgs.msg import Transition

STEP = 0.01
"""The communication step of the FMU and the period of the topics, s."""


def generate_launch_description() -> launch.LaunchDescription:
    """Return the node of the FMU, which is configured and then activated."""
    node = LifecycleNode(
        package="fmi_adapter",
        executable="fmi_adapter_node",
        name="fmi_adapter_node",
        namespace="videoray",
        parameters=[{"fmu_path": LaunchConfiguration("fmu_path"), "step_size": STEP, "update_period": STEP}],
        output="screen",
    )

    def change(transition: int) -> EmitEvent:
        event = ChangeState(lifecycle_node_matcher=matches_action(node), transition_id=transition)
        return EmitEvent(event=event)

    activated = OnStateTransition(
        target_lifecycle_node=node, goal_state="inactive", entities=[change(Transition.TRANSITION_ACTIVATE)]
    )
    return launch.LaunchDescription(
        [
            DeclareLaunchArgument("fmu_path", description="The FMU, built with --interface cs"),
            RegisterEventHandler(activated),
            node,
            change(Transition.TRANSITION_CONFIGURE),
        ]
    )
