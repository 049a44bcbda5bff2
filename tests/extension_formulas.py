"""What glTF's appendix B and its material extensions make of light, in double precision and independent of the renderer.

Vectors are tuples; all directions point away from the surface. Colors are lists of three. Where docs/passes.md states a
choice of HPR's own (reciprocal coats, Fresnel's equations at films and at surfaces that transmit), it is the one here.
"""

import functools
import math


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def scaled(a, factor):
    return tuple(x * factor for x in a)


def plus(a, b):
    return tuple(x + y for x, y in zip(a, b))


def normalized(a):
    return scaled(a, 1 / math.sqrt(dot(a, a)))


def mix(a, b, share):
    return [x * (1 - share) + y * share for x, y in zip(a, b)]


# Fresnel's term.

def rise(cosine):
    """From 0 looked at straight to 1 edge-on: Schlick's."""
    return (1 - min(max(cosine, 0), 1)) ** 5


def f0_of(ior, outside=1.0):
    return ((ior - outside) / (ior + outside)) ** 2


def fresnel_equations(cosine, eta):
    """Unpolarized light that meets a medium of the relative index `eta`."""
    sine = math.sqrt(max(0.0, 1 - cosine * cosine)) / eta
    if sine >= 1:
        return 1.0
    through = math.sqrt(1 - sine * sine)
    perpendicular = (cosine - eta * through) / (cosine + eta * through)
    parallel = (eta * cosine - through) / (eta * cosine + through)
    return (perpendicular ** 2 + parallel ** 2) / 2


@functools.lru_cache(maxsize=None)
def mean_entering(ior):
    """The share of even light from all sides that enters: by quadrature over the squared cosine."""
    steps = 20000
    return 1 - sum(fresnel_equations(math.sqrt((i + 0.5) / steps), ior) for i in range(steps)) / steps


XYZ_TO_RGB = ((3.2404542, -1.5371385, -0.4985314), (-0.9692660, 1.8760108, 0.0415560), (0.0556434, -0.2040259, 1.0572252))


def film_reflectance(cosine, ior, nm, base_f0):
    """KHR_materials_iridescence: two interferences past the mean; the film's own face by Fresnel's equations."""
    blend = min(max(nm / 0.03, 0), 1)
    ior = 1 + (ior - 1) * blend * blend * (3 - 2 * blend)
    inside2 = 1 - (1 - cosine * cosine) / ior ** 2
    if inside2 < 0:
        return [1.0] * 3
    inside = math.sqrt(inside2)
    r12 = fresnel_equations(cosine, ior)
    path = 2 * ior * nm * inside

    def channels(order, shifts):
        """The response to a cosine over wavelengths, in linear sRGB."""
        phase = 2 * math.pi * order * path * 1e-9

        def lobe(value, position, variance, shift):
            return (value * math.sqrt(2 * math.pi * variance) * math.cos(position * phase + shift)
                    * math.exp(-variance * phase * phase))
        xyz = (lobe(5.4856e-13, 1.6810e6, 4.3278e9, shifts[0]) + lobe(9.7470e-14, 2.2399e6, 4.5282e9, shifts[0]),
               lobe(4.4201e-13, 1.7953e6, 9.3046e9, shifts[1]), lobe(5.2481e-13, 2.2084e6, 6.6121e9, shifts[2]))
        return [dot(row, xyz) / 1.0685e-7 for row in XYZ_TO_RGB]
    shifts, r23 = [], []
    for f0 in base_f0:
        root = math.sqrt(min(f0, 0.9999))
        base_ior = (1 + root) / (1 - root)
        shifts.append((math.pi if ior >= 1 else 0) + (math.pi if base_ior < ior else 0))
        bottom = f0_of(base_ior, ior)
        r23.append(bottom + (1 - bottom) * rise(inside))
    waves = [channels(order, [order * shift for shift in shifts]) for order in (1, 2)]
    result = []
    for c in range(3):
        both = min(r12 * r23[c], 0.9999)
        later = (1 - r12) ** 2 * r23[c] / (1 - both)
        value = r12 + later
        for order in (1, 2):
            value += (later - (1 - r12)) * math.sqrt(both) ** order * 2 * waves[order - 1][c]
        result.append(min(max(value, 0), 1))
    return result


# Microfacets.

def ggx(normal_half, alpha):
    return alpha ** 2 / (math.pi * (normal_half ** 2 * (alpha ** 2 - 1) + 1) ** 2)


def smith_visibility(normal_light, normal_view, alpha):
    """G / (4 n.l n.v), height-correlated."""
    def term(a, b):
        return a * math.sqrt(alpha ** 2 + (1 - alpha ** 2) * b * b)
    return 0.5 / (term(normal_light, normal_view) + term(normal_view, normal_light))


def anisotropic_facets(surface, light, along, across):
    """D V of KHR_materials_anisotropy, alphas along and across the surface's direction."""
    across_direction = cross(surface.normal, surface.direction)

    def local(w):
        return dot(w, surface.direction), dot(w, across_direction), dot(w, surface.normal)
    half = local(normalized(plus(surface.view, light)))
    spread = along * across
    f = (across * half[0], along * half[1], spread * half[2])
    distribution = spread * (spread / dot(f, f)) ** 2 / math.pi
    view, to_light = local(surface.view), local(light)
    length_view = math.hypot(along * view[0], across * view[1], view[2])
    length_light = math.hypot(along * to_light[0], across * to_light[1], to_light[2])
    return distribution * 0.5 / (to_light[2] * length_view + view[2] * length_light)


# Sheen.

def sheen_alpha(roughness):
    return max(roughness ** 2, 5e-3)


def sheen(normal_light, normal_view, normal_half, alpha):
    """Conty Estevez and Kulla's cloth."""
    flat = (1 - alpha) ** 2
    a, b, c, d, e = (rough + (smooth - rough) * flat for rough, smooth in (
        (21.5473, 25.3245), (3.82987, 3.32435), (0.19823, 0.16801), (-1.97760, -1.27393), (-4.32054, -4.85967)))

    def fitted(x):
        return a / (1 + b * x ** c) + d * x + e

    def shadowing(cosine):
        return math.exp(fitted(cosine)) if cosine < 0.5 else math.exp(2 * fitted(0.5) - fitted(1 - cosine))
    distribution = (2 + 1 / alpha) * (1 - normal_half ** 2) ** (0.5 / alpha) / (2 * math.pi)
    return distribution / ((1 + shadowing(normal_view) + shadowing(normal_light)) * 4 * normal_view * normal_light)


@functools.lru_cache(maxsize=None)
def sheen_albedo(roughness, normal_view):
    """The share of a furnace's light that white sheen reflects: by quadrature, denser where light grazes."""
    steps, sectors = 96, 64
    alpha, sine_view = sheen_alpha(roughness), math.sqrt(1 - normal_view ** 2)
    total = 0.0
    for i in range(steps):
        root = (i + 0.5) / steps
        cosine = root * root
        sine = math.sqrt(1 - cosine * cosine)
        for j in range(sectors):
            toward = sine_view * sine * math.cos(math.pi * (j + 0.5) / sectors) + normal_view * cosine
            normal_half = min((normal_view + cosine) / math.sqrt(2 + 2 * toward), 1.0)
            total += sheen(cosine, normal_view, normal_half, alpha) * cosine * 2 * root
    return total * 2 * math.pi / (steps * sectors)


class Surface:
    """One place of a material, looked at from `view`. Keywords are the values that its factors and textures make."""

    def __init__(self, view, normal=(0.0, 0.0, 1.0), direction=(1.0, 0.0, 0.0), **values):
        self.view, self.normal, self.direction = view, normal, direction
        self.base = [1.0] * 3
        self.metallic, self.roughness, self.ior = 0.0, 1.0, 1.5
        self.specular, self.specular_color = 1.0, [1.0] * 3
        self.transmission, self.solid = 0.0, False
        self.clearcoat, self.coat_roughness, self.coat_normal = 0.0, 0.0, normal
        self.sheen_color, self.sheen_roughness = [0.0] * 3, 0.0
        self.anisotropy = 0.0
        self.film, self.film_ior, self.film_nm = 0.0, 1.3, 0.0
        self.diffuse_transmission, self.through_color = 0.0, [1.0] * 3
        for name, value in values.items():
            if name not in self.__dict__:
                raise KeyError(name)
            setattr(self, name, value)

    def dielectric(self, cosine):
        """Its reflectance a channel."""
        plain = f0_of(self.ior) if self.ior > 0 else 1.0
        f0 = [min(plain * color, 1) for color in self.specular_color]
        if self.ior == 1:
            term = [0.0] * 3
        else:
            share = rise(cosine)
            if self.transmission > 0 and self.ior > 0:
                share = (fresnel_equations(cosine, self.ior) - plain) / (1 - plain)
            term = [self.specular * (low + (1 - low) * share) for low in f0]
        if self.film > 0:
            film = film_reflectance(cosine, self.film_ior, self.film_nm, [self.specular * low for low in f0])
            term = mix(term, film, self.film)
        return term

    def metal(self, cosine):
        term = [low + (1 - low) * rise(cosine) for low in self.base]
        if self.film > 0:
            term = mix(term, film_reflectance(cosine, self.film_ior, self.film_nm, self.base), self.film)
        return term

    def reflectance(self, cosine):
        """Of the dielectric and the metal by their shares."""
        return mix(self.dielectric(cosine), self.metal(cosine) if self.metallic > 0 else [0.0] * 3, self.metallic)

    def facets(self, light):
        half = normalized(plus(self.view, light))
        normal_view, normal_light = dot(self.normal, self.view), dot(self.normal, light)
        alpha = self.roughness ** 2
        if self.anisotropy > 0:
            return anisotropic_facets(self, light, alpha + (1 - alpha) * self.anisotropy ** 2, alpha)
        return ggx(dot(self.normal, half), alpha) * smith_visibility(normal_light, normal_view, alpha)

    def below_sheen(self, light):
        """The lesser of both directions' shares, as the extension has it."""
        color = max(self.sheen_color)
        if color == 0:
            return 1.0
        return min(1 - color * sheen_albedo(self.sheen_roughness, abs(dot(self.normal, w))) for w in (self.view, light))

    def below_coat(self, light):
        """The lesser share of both directions: the extension's own formula knows the viewer's."""
        return min(self.coat_share(w) for w in (self.view, light))

    def coat_share(self, direction):
        return 1 - self.clearcoat * (0.04 + 0.96 * rise(abs(dot(self.coat_normal, direction))))

    def diffuse_enters(self, light):
        """What the specular layer leaves of the light to the base."""
        if self.transmission > 0 and self.ior > 0:
            share = 1.0
            for w in (self.view, light):
                share *= 1 - max(self.dielectric(dot(self.normal, w)))
            return share / mean_entering(self.ior)
        return 1 - max(self.dielectric(dot(self.view, normalized(plus(self.view, light)))))

    def reflected(self, light):
        """f times the light's cosine, for light on the viewer's side."""
        normal_light = dot(self.normal, light)
        half = normalized(plus(self.view, light))
        cosine = dot(self.view, half)
        base = (1 - self.metallic) * (1 - self.transmission) * (1 - self.diffuse_transmission)
        enters = self.diffuse_enters(light) if base > 0 else 0.0
        facets, term = self.facets(light), self.reflectance(cosine)
        under = self.below_sheen(light)
        result = [under * (base * enters * color / math.pi + facets * f) for color, f in zip(self.base, term)]
        if max(self.sheen_color) > 0:
            cloth = sheen(normal_light, dot(self.normal, self.view), dot(self.normal, half), sheen_alpha(self.sheen_roughness))
            result = [value + cloth * color for value, color in zip(result, self.sheen_color)]
        if self.clearcoat == 0:
            return [value * normal_light for value in result]
        result = [value * self.below_coat(light) * normal_light for value in result]
        coat_light, coat_view = dot(self.coat_normal, light), dot(self.coat_normal, self.view)
        if coat_light > 0:
            alpha = self.coat_roughness ** 2
            coat = (self.clearcoat * (0.04 + 0.96 * rise(cosine)) * ggx(dot(self.coat_normal, half), alpha)
                    * smith_visibility(coat_light, coat_view, alpha) * coat_light)
            result = [value + coat for value in result]
        return result

    def diffusely_transmitted(self, light):
        """f times the cosine, for light on the other side; the specular layer leaves the lesser of both directions' shares."""
        share = (1 - self.metallic) * (1 - self.transmission) * self.diffuse_transmission
        enters = min(1 - max(self.dielectric(abs(dot(self.normal, w)))) for w in (self.view, light))
        cosine = -dot(self.normal, light)
        return [share * enters * color * cosine / math.pi for color in self.through_color]

    def transmitted(self, light):
        """f times the cosine of rough transmission, for light on the other side: radiance, which refraction squeezes."""
        alpha, cosine = self.roughness ** 2, -dot(self.normal, light)
        normal_view = dot(self.normal, self.view)
        share = (1 - self.metallic) * self.transmission
        if not self.solid:
            turned = plus(light, scaled(self.normal, 2 * cosine))
            half = normalized(plus(self.view, turned))
            lobe = ggx(dot(self.normal, half), alpha) * smith_visibility(cosine, normal_view, alpha)
            enters = 1 - max(self.dielectric(dot(self.view, half)))
            return [share * color * enters * lobe * cosine for color in self.base]
        # Walter et al. 2007, equations 16 and 21.
        half = scaled(normalized(plus(self.view, scaled(light, self.ior))), -1)
        if dot(half, self.normal) < 0:
            half = scaled(half, -1)
        view_half, light_half = dot(self.view, half), dot(light, half)
        if view_half <= 0 or light_half >= 0:
            return [0.0] * 3  # facets that turn away from either
        masked = 4 * cosine * normal_view * smith_visibility(cosine, normal_view, alpha)
        lobe = (abs(view_half * light_half) / (cosine * normal_view) * masked * ggx(dot(self.normal, half), alpha)
                / (view_half + self.ior * light_half) ** 2)
        enters = 1 - fresnel_equations(abs(view_half), self.ior)
        return [share * math.sqrt(color) * enters * lobe * cosine for color in self.base]
