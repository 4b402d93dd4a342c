"""Warning groups in one lane, for the tests of warnings."""

import networkx as nx

from tests.lcca.road import Air, Road, places, true_places


def row(
    names: str,
    air: Air | None = None,
    seed: int = 0,
    gap_m: float = 20.0,
    *,
    proves_ids: bool = False,
) -> Road:
    """One group in one lane, formed."""
    road = Road(air, seed=seed, proves_ids=proves_ids)
    road.add_row(names, gap_m)
    road.run(5.0)
    assert places(road) == true_places(road)
    return road


def warned(road: Road) -> str:
    return "".join(car.name for car in road.cars.values() if car.warnings)


def fewest_transmissions(road: Road, origin: str, last: str) -> int:
    """The oracle: a row is covered from `origin` to `last` by no fewer than a shortest path."""
    behind = [
        car.name for car in road.cars.values() if car.position_m <= road.cars[origin].position_m
    ]
    return int(nx.shortest_path_length(road.air_graph().subgraph(behind), origin, last))
