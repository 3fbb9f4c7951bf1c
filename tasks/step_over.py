"""A heavy hexapod walks over blocks: two legs tread on top of them, two more step over, two pass between.

The body stays 0.6 m above the floor, in tripod gait along its x axis with steps of 0.3 m; feet are lifted by
0.34 m.

Source: Zhuang, Gao, Deng, "Gait planning research for an electrically driven large-load-ratio six-legged
robot", 2017, the second experiment: body height, lift and step are the paper's. Of the obstacle
it only tells that legs 4 and 6 tread on it and the others do not; the blocks are chosen here.
"""

from __future__ import annotations

import wbplan as wb

ROBOT = "heavy_hexapod"


def script(
    robot: wb.Robot,
    *,
    distance: float = 2.4,
    stroke: float = 0.3,
    lift: float = 0.34,
    height: float = 0.6,
    radius: float = 1.1,
    block_height: float = 0.2,
    block_length: float = 0.25,
    block_width: float = 0.3,
    block_x: float = 1.2,
    step_time: float | None = 6.0,
    margin: float = 0.1,
    friction: float = 0.7,
) -> wb.Script:
    """The crossing.

    Args:
        robot: the heavy hexapod.
        distance: of the walk [m].
        stroke: how far a foot goes in the body's frame while it stands [m]; the paper's step.
        lift: how high feet rise [m].
        height: of the body over the floor [m].
        radius: of the circle that the feet stand on [m]; not given in the paper.
        block_height: of both blocks [m]; 0 leaves them out.
        block_length: along the walk [m].
        block_width: across it [m].
        block_x: middle of the blocks [m]; where legs 4 and 6 land.
        step_time: of a step [s]; in 5 s the legs' accelerations make the body dip by 8 mm. As short as
            joints' speeds allow where none is given.
        margin: stability margin kept throughout [m].
        friction: of the feet [-].
    """
    walker = wb.gaits.Walker(robot)
    stance = walker.stance(height=height, radius=radius)
    blocks = []
    for leg in ("leg4", "leg6"):
        middle = (block_x, float(stance.feet[leg][1]), 0.5 * block_height)
        if block_height > 0.0:
            box = wb.Box((block_length, block_width, block_height))
            blocks.append(wb.Obstacle(f"block of {leg}", box, middle, friction))
    obstacles = wb.Obstacles([wb.Obstacle("floor", wb.Ground(), friction=friction), *blocks])
    ground = wb.gaits.over(obstacles.terrain)
    manner = wb.gaits.Manner(
        step_time=step_time,
        height=lift,
        clearance=0.05,
        margin=margin,
        friction=friction,
        follow=0.0,
        limits=(obstacles, wb.SelfCollision()),
    )
    return wb.gaits.walk(
        walker,
        wb.gaits.tripod(walker.ring),
        wb.gaits.straight(distance),
        stroke,
        stance=stance,
        manner=manner,
        ground=ground,
        place=wb.gaits.firm(ground, 0.05, 0.1),
    ).script
