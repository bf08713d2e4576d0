"""The time left of a long work, from the share of it that is done."""

from rich.progress import Task, TaskID

from rov_fmu.report.progress import TimeLeftColumn


def test_the_time_left_counts_down_from_the_last_known_share() -> None:
    clock = [0.0]
    column, task = TimeLeftColumn(), Task(TaskID(0), "", total=1.0, completed=0.0, _get_time=lambda: clock[0])
    task.start_time = 0.0
    shown = []
    for now, share in ((1.0, 0.0), (10.0, 0.1), (40.0, 0.1), (150.0, 0.1), (160.0, 0.8), (190.0, 0.8)):
        clock[0], task.completed = now, share
        shown.append(column.render(task).plain)
    assert shown == ["", *(f"about {left} left" for left in ("1:30", "1:00", "0:00", "0:40", "0:10"))]
