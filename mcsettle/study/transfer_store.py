"""The store of transfer functions that the parameter sets of a study share."""

from mcsettle.step_a.transfers import TransferStore
from mcsettle.study.study import Study

# Keys of a layer that its bases depend on; laws, strengths and K0 leave them as they are.
ELASTIC = {"youngs_modulus_pa", "poisson", "density_kg_per_m3", "damping"}


def transfer_store(study: Study) -> TransferStore:
    """An empty store for the parameter sets of ``study``."""
    loads = {name: train.cars[0].axle_load for name, train in study.trains.items()}
    inputs = [path for entry in study.uncertain for path in entry.paths]
    many = study.grounds_table is not None or any(
        path.startswith("track.") and path.rsplit(".", 1)[-1] in ELASTIC for path in inputs
    )
    return TransferStore(axle_loads=loads, many_grounds=many)
