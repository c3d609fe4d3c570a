"""What a scene says of light that goes through the pigment epithelium and comes back elsewhere, channel by channel.

The share that does and how far it goes are the closed form's (`scene.fundus`) and the Monte Carlo's (`scene.spread`) at
the perifovea, in the spotlights' light as the sensor sees it. Over a real retina the local and the deep albedo differ
from place to place, and every scattering coefficient is known to a factor of two: a fit takes both for uncertain.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from conespot.scene import fundus
from conespot.scene.illumination import Illumination
from conespot.scene.retina import Fundus, Spread
from conespot.scene.scene import Scene
from conespot.scene.sensor import Sensor
from conespot.scene.spectrum import Curve
from conespot.scene.spread import Kernel, spread_kernel

Array = NDArray[np.float64]
#: a share below this is none: green light's is half of it
_LEAST_SHARE = 0.01
#: wavelengths at which a channel's light is looked at, and those of kernels, which change slowly
_POINTS, _KERNELS = 401, 9


@dataclass(frozen=True, eq=False)
class Deep:
    """The deep light of the channels of an image."""

    shares: Array  #: of the light that comes back from under the retina `[C]`
    kernels: tuple[Kernel, ...]  #: by which it has spread `[C]`

    @classmethod
    def of(cls, scene: Scene) -> Deep | None:
        """The deep light of the spotlights in a scene; None where no light spreads, or too little to be seen."""
        retina = scene.retina
        if not isinstance(retina, Fundus) or retina.spread is None:
            return None
        spread = retina.spread
        plain = retina.model_copy(update={"spread": Spread(scattering=spread.scattering)})
        usual = _usual(plain, scene.illumination, scene.sensor)
        if usual.shares.max() < _LEAST_SHARE:
            return None
        odds = spread.amount * usual.shares
        kernels = tuple(replace(kernel, length=spread.length) for kernel in usual.kernels)
        return cls(odds / (1.0 - usual.shares + odds), kernels)


@functools.lru_cache(maxsize=16)
def _usual(retina: Fundus, illumination: Illumination, sensor: Sensor) -> Deep:
    """The deep light of the closed form and the table."""
    assert retina.spread is not None
    pigments = replace(fundus.SITES["perifovea"], melanin=fundus.MELANIN[retina.pigmentation])
    light, responses = illumination.spectrum, sensor.responses
    shares, kernels = [], []
    for film in [light] if responses is None else [light.times(response) for response in responses.values()]:
        x = np.linspace(film.low, film.high, _POINTS)
        seen = np.maximum(film(x), 0.0)
        whole = fundus.reflectance(x, pigments)
        # only the macular pigment is in front of the epithelium, which reflects before its melanin
        front = pigments.epithelium * 10.0 ** (-2.0 * pigments.macular * fundus.macular_template(x))
        deep = Curve(x, seen * (whole - front))
        total = float(np.trapezoid(seen * whole, x))
        shares.append(deep.integral() / total if total > 0.0 else 0.0)
        kernels.append(_mean_kernel(deep, retina, retina.spread))
    return Deep(np.array(shares), tuple(kernels))


def _mean_kernel(deep: Curve, retina: Fundus, spread: Spread) -> Kernel:
    """The kernel of light of several wavelengths."""
    x = np.linspace(deep.low, deep.high, _KERNELS)
    half = (x[1] - x[0]) / 2.0
    weights = np.array([deep.integral(at - half, at + half) for at in x.tolist()])
    if not weights.sum() > 0.0:
        weights[:] = 1.0
    parts = [spread_kernel(wavelength, retina.pigmentation, spread.scattering).parts for wavelength in x.tolist()]
    return Kernel(weights / weights.sum() @ np.stack(parts))
