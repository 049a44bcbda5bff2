"""glTF files of every material extension that HPR draws, and what their specifications make of light.

Four tiles a model, each a flat surface of one material at an angle of its own, looked at from above. Most are lit by one
directional light, straight or aslant, without shadows (`--passes none`): a pixel is then f cos E. Mirrors and clear glass show an
even environment or a backdrop of colors that run across it. Half of the factors have textures of one texel. Tolerances
are relative: what single precision makes of factors, directions of light and narrow lobes, but for sheen.
"""

import math

from extension_formulas import Surface, cross, dot, fresnel_equations, normalized, plus, scaled
from extension_models import Model, as_float, flat, srgb_to_linear

UP = (0.0, 0.0, 1.0)  # where the eye is
TILES = [(-1, 1), (1, 1), (-1, -1), (1, -1)]
TILE_DEPTH = 50.0  # tiles lie below each other, so that none is in another's light
ROUNDED = 2e-4
SHEEN = 3e-3  # the renderer's table of its albedo holds 0.002


def pixels_of(tile):
    """The four about the tile's center."""
    column, row = 4 * (tile % 2), 4 * (tile // 2)
    return [(column + i, row + j) for j in (1, 2) for i in (1, 2)]


def drawn_direction(random, max_degrees, min_degrees=0.0, about=UP):
    polar = math.radians(random.uniform(min_degrees, max_degrees))
    around = random.uniform(0, 2 * math.pi)
    side = normalized(cross(about, (1.0, 0.0, 0.0) if abs(about[0]) < 0.9 else (0.0, 1.0, 0.0)))
    other = cross(about, side)
    flat_part = plus(scaled(side, math.cos(around)), scaled(other, math.sin(around)))
    return plus(scaled(flat_part, math.sin(polar)), scaled(about, math.cos(polar)))


def drawn_color(random, low=0.05, high=1.0):
    return [as_float(random.uniform(low, high)) for _ in range(3)]


class Tiles(Model):
    """A model of four flat surfaces: none of them on the way of another's light."""

    def __init__(self, random):
        super().__init__()
        self.random = random
        self.parts = {}  # of the material's extensions
        self.pbr = {}
        self.core = {}

    def extension(self, name):
        return self.parts.setdefault(name, {})

    def texture(self, holder, name):
        """A drawn texel, put where `holder` names its texture."""
        texel = [self.random.randint(40, 255) for _ in range(4)]
        holder[name] = {"index": self.texel(texel)}
        return texel

    def factor(self, holder, name, texture=None, channel=0, low=0.0, high=1.0):
        """A drawn factor, and half of the time a texture whose channel it is multiplied with; its value."""
        value = holder[name] = as_float(self.random.uniform(low, high))
        if texture is not None and self.random.random() < 0.5:
            value *= self.texture(holder, texture)[channel] / 255
        return value

    def color(self, holder, name, texture=None, low=0.0, high=1.0):
        value = holder[name] = drawn_color(self.random, low, high)
        if texture is not None and self.random.random() < 0.5:
            texel = self.texture(holder, texture)
            value = [factor * srgb_to_linear(level) for factor, level in zip(value, texel)]
        return value

    def base(self, roughness=(0.25, 1.0), metallic=True, color=(0.05, 1.0)):
        """The values of glTF's own material."""
        self.pbr["baseColorFactor"] = drawn_color(self.random, *color) + [1.0]
        self.pbr["roughnessFactor"] = as_float(self.random.uniform(*roughness))
        self.pbr["metallicFactor"] = as_float(self.random.uniform(0, 1)) if metallic and self.random.random() < 0.4 else 0.0
        return {"base": self.pbr["baseColorFactor"][:3], "roughness": self.pbr["roughnessFactor"],
                "metallic": self.pbr["metallicFactor"]}

    def made_material(self):
        return self.material(self.parts or None, self.pbr, **self.core)

    def surface(self, tile, normal, material, tangent=None, handedness=1.0):
        """What of the plane through the tile's center is seen there, and the tangent and bitangent."""
        side = tangent or normalized(cross((0.0, 1.0, 0.0), normal))
        up = cross(normal, side)
        corners = [(x, y, -(normal[0] * x + normal[1] * y) / normal[2])
                   for x, y in ((-0.6, -0.6), (0.6, -0.6), (0.6, 0.6), (-0.6, 0.6))]
        attributes = {"POSITION": self.positions(corners), "NORMAL": self.accessor([normal] * 4),
                      "TANGENT": self.accessor([[*side, handedness]] * 4),
                      "TEXCOORD_0": self.accessor([[0, 1], [1, 1], [1, 0], [0, 0]])}
        primitive = {"attributes": attributes, "indices": self.indices([(0, 1, 2), (0, 2, 3)]), "material": material}
        self.node(mesh=self.mesh(primitive), translation=self.center(tile))
        return side, scaled(up, handedness)

    def center(self, tile):
        return [*TILES[tile], -TILE_DEPTH * tile]

    def sun(self, direction):
        """A directional light from there; its irradiance on what faces it."""
        color, strength = drawn_color(self.random, 0.2), as_float(self.random.uniform(0.5, 5))
        x, y, z = direction
        if z < -1 + 1e-12:
            rotation = [1.0, 0.0, 0.0, 0.0]
        else:
            rotation = [-y, x, 0.0, 1 + z]  # turns +z to the direction, and -z away from it
        length = math.sqrt(dot(rotation, rotation))
        self.light({"type": "directional", "color": color, "intensity": strength},
                   rotation=[c / length for c in rotation])
        return [c * strength for c in color]

    def expect_tile(self, tile, color, relative=ROUNDED, absolute=1e-6):
        for pixel in pixels_of(tile):
            self.expect(pixel, color, relative, absolute)


def lit(tiles, values, emission=(0.0, 0.0, 0.0), surface_of=None, relative=ROUNDED):
    """Lights the surfaces from their front: the first by its mirror direction, where coats and films are what their
    extensions say to the letter. `surface_of(normal, side, other side)`: values that depend on the tangents."""
    random = tiles.random
    toward = drawn_direction(random, 75)
    irradiance = tiles.sun(toward)
    material = tiles.made_material()
    for tile in range(1 if max(emission) > 0 else 4):  # what emits would light the others
        normal = normalized(plus(UP, toward))
        if tile > 0 or max(emission) > 0 and random.random() < 0.5:
            normal = drawn_direction(random, 75)
            while dot(normal, toward) < 0.15:
                normal = drawn_direction(random, 75)
        handedness = random.choice([-1.0, 1.0])
        angle = random.uniform(0, 2 * math.pi)
        side = normalized(cross((0.0, 1.0, 0.0), normal))
        side = plus(scaled(side, math.cos(angle)), scaled(cross(normal, side), math.sin(angle)))
        tangents = tiles.surface(tile, normal, material, side, handedness)
        more = surface_of(normal, *tangents) if surface_of else {}
        if more is None:
            continue
        surface = Surface(UP, normal, **values | more)
        shine = surface.coat_share(UP)
        tiles.expect_tile(tile, [f * e + shine * g for f, e, g in zip(surface.reflected(toward), irradiance, emission)],
                          relative)
    tiles.arguments += ["--passes", "none"]
    return tiles


def mirroring(tiles, values):
    """Smooth surfaces without a diffuse base show an even environment by their reflectance alone."""
    random = tiles.random
    tiles.pbr["roughnessFactor"] = 0.0
    material = tiles.made_material()
    light = drawn_color(random, 0.3, 2)
    for tile in range(4):
        normal = drawn_direction(random, 80, 5)
        tiles.surface(tile, normal, material)
        surface = Surface(UP, normal, **values)
        cosine = dot(UP, normal)
        below = surface.coat_share(UP)
        tiles.expect_tile(tile, [(1 - below + below * share) * e for share, e in zip(surface.reflectance(cosine), light)])
    tiles.arguments += ["--passes", "reflection", "--environment", ",".join(map(repr, light))]
    return tiles


def lit_or_mirroring(tiles, number, values):
    return mirroring(tiles, values) if number % 4 == 3 else lit(tiles, values)


def base_of(tiles, number, **options):
    """Every fourth model is a mirror without a diffuse base."""
    return tiles.base(color=(0, 0), metallic=False) if number % 4 == 3 else tiles.base(**options)


def specular(random, number):
    tiles = Tiles(random)
    values = base_of(tiles, number)
    holder = tiles.extension("KHR_materials_specular")
    values["specular"] = tiles.factor(holder, "specularFactor", "specularTexture", 3)
    values["specular_color"] = tiles.color(holder, "specularColorFactor", "specularColorTexture", 0, 3)
    if random.random() < 0.5:
        values["ior"] = tiles.factor(tiles.extension("KHR_materials_ior"), "ior", low=1, high=2.5)
    return lit_or_mirroring(tiles, number, values)


def ior(random, number):
    if number % 5 == 4:
        return glass(random, number, dispersion=False)
    tiles = Tiles(random)
    values = base_of(tiles, number)
    holder = tiles.extension("KHR_materials_ior")
    values["ior"] = holder["ior"] = {0: 0.0, 1: 1.0}.get(number, as_float(random.uniform(1, 3)))
    return lit_or_mirroring(tiles, number, values)


def clearcoat(random, number):
    """Coats of normals of their own, and over emission."""
    tiles = Tiles(random)
    values = base_of(tiles, number)
    holder = tiles.extension("KHR_materials_clearcoat")
    values["clearcoat"] = tiles.factor(holder, "clearcoatFactor", "clearcoatTexture", 0)
    if number % 4 == 3:
        return mirroring(tiles, values)
    values["coat_roughness"] = tiles.factor(holder, "clearcoatRoughnessFactor", "clearcoatRoughnessTexture", 1, 0.5)
    emission = (0.0, 0.0, 0.0)
    if number % 2:
        emission = tiles.core["emissiveFactor"] = drawn_color(random)
    if number % 3:
        return lit(tiles, values, emission)
    texel = [random.randint(90, 165), random.randint(90, 165), 255, 255]
    scale = as_float(random.uniform(0.2, 1.5))
    holder["clearcoatNormalTexture"] = {"index": tiles.texel(texel), "scale": scale}

    def coat_normal(normal, side, other):
        x, y, z = ((2 * level / 255 - 1) * by for level, by in zip(texel, (scale, scale, 1)))
        turned = normalized(plus(plus(scaled(side, x), scaled(other, y)), scaled(normal, z)))
        return {"coat_normal": turned} if dot(turned, UP) > 1e-3 else None
    return lit(tiles, values, emission, coat_normal)


def sheen(random, number):
    tiles = Tiles(random)
    values = tiles.base()
    holder = tiles.extension("KHR_materials_sheen")
    values["sheen_color"] = tiles.color(holder, "sheenColorFactor", "sheenColorTexture")
    values["sheen_roughness"] = tiles.factor(holder, "sheenRoughnessFactor", "sheenRoughnessTexture", 3, 0.1)
    return lit(tiles, values, relative=SHEEN)


def anisotropy(random, number):
    tiles = Tiles(random)
    values = tiles.base(metallic=number % 2 == 0)
    holder = tiles.extension("KHR_materials_anisotropy")
    strength = holder["anisotropyStrength"] = as_float(random.uniform(0.1, 1))
    angle = holder["anisotropyRotation"] = as_float(random.uniform(-4, 4))
    x, y = 1.0, 0.0
    if random.random() < 0.5:
        texel = [random.choice((random.randint(0, 90), random.randint(165, 255))) for _ in range(2)] + [
            random.randint(60, 255), random.randint(0, 255)]
        holder["anisotropyTexture"] = {"index": tiles.texel(texel)}
        x, y = (2 * level / 255 - 1 for level in texel[:2])
        strength *= texel[2] / 255
    values["anisotropy"] = strength
    c, s = math.cos(angle), math.sin(angle)

    def direction(_, side, other):
        return {"direction": normalized(plus(scaled(side, c * x - s * y), scaled(other, s * x + c * y)))}
    return lit(tiles, values, surface_of=direction)


def iridescence(random, number):
    tiles = Tiles(random)
    values = base_of(tiles, number)
    holder = tiles.extension("KHR_materials_iridescence")
    values["film"] = tiles.factor(holder, "iridescenceFactor", "iridescenceTexture", 0)
    values["film_ior"] = tiles.factor(holder, "iridescenceIor", low=1.0, high=2.2)
    low = holder["iridescenceThicknessMinimum"] = as_float(random.uniform(0, 500))
    high = holder["iridescenceThicknessMaximum"] = as_float(random.uniform(0, 1200))
    values["film_nm"] = high
    if random.random() < 0.5:
        share = tiles.texture(holder, "iridescenceThicknessTexture")[1] / 255
        values["film_nm"] = low + (high - low) * share
    if random.random() < 0.3:
        more = tiles.extension("KHR_materials_specular")
        values["specular"] = tiles.factor(more, "specularFactor")
        values["specular_color"] = tiles.color(more, "specularColorFactor", high=2)
    return lit_or_mirroring(tiles, number, values)


def emissive_strength(random, number):
    tiles = Tiles(random)
    tiles.base(color=(0, 0), metallic=False)
    tiles.extension("KHR_materials_ior")["ior"] = 1  # they reflect nothing of each other
    color = tiles.color(tiles.core, "emissiveFactor", "emissiveTexture")
    strength = tiles.factor(tiles.extension("KHR_materials_emissive_strength"), "emissiveStrength", high=20 ** (number % 3))
    material = tiles.made_material()
    for tile in range(4):
        tiles.surface(tile, drawn_direction(random, 75), material)
        tiles.expect_tile(tile, [strength * c for c in color], 1e-6)
    tiles.arguments += ["--passes", "none"]
    return tiles


def unlit(random, number):
    """Neither lights nor anything else of the material counts."""
    tiles = Tiles(random)
    tiles.base()
    color = tiles.pbr["baseColorFactor"][:3]
    if number % 2:
        texel = tiles.texture(tiles.pbr, "baseColorTexture")
        color = [factor * srgb_to_linear(level) for factor, level in zip(color, texel)]
    tiles.core["emissiveFactor"] = drawn_color(random)
    tiles.extension("KHR_materials_unlit")
    if number % 3 == 0:
        tiles.extension("KHR_materials_clearcoat")["clearcoatFactor"] = 1
    tiles.sun(drawn_direction(random, 60))
    material = tiles.made_material()
    for tile in range(4):
        tiles.surface(tile, drawn_direction(random, 75), material)
        tiles.expect_tile(tile, color, 1e-6)
    return tiles


def lit_from_behind(tiles, values, transmitted):
    """`transmitted(surface, direction)`: f cos."""
    random = tiles.random
    below = drawn_direction(random, 60, about=(0.0, 0.0, -1.0))
    irradiance = tiles.sun(below)
    material = tiles.made_material()
    for tile in range(4):
        normal = drawn_direction(random, 60)
        while dot(normal, below) > -0.15:
            normal = drawn_direction(random, 60)
        tiles.surface(tile, normal, material)
        surface = Surface(UP, normal, **values)
        tiles.expect_tile(tile, [f * e for f, e in zip(transmitted(surface, below), irradiance)])
    tiles.arguments += ["--passes", "none"]
    return tiles


def diffuse_transmission(random, number):
    tiles = Tiles(random)
    values = tiles.base()
    holder = tiles.extension("KHR_materials_diffuse_transmission")
    values["diffuse_transmission"] = tiles.factor(holder, "diffuseTransmissionFactor", "diffuseTransmissionTexture", 3)
    values["through_color"] = tiles.color(holder, "diffuseTransmissionColorFactor", "diffuseTransmissionColorTexture")
    if random.random() < 0.5:
        values["specular"] = tiles.factor(tiles.extension("KHR_materials_specular"), "specularFactor")
    if number % 3 == 0:
        return lit(tiles, values)
    return lit_from_behind(tiles, values, Surface.diffusely_transmitted)


def transmission(random, number):
    """Rough sheets and solids lit from either side, clear sheets over a backdrop."""
    tiles = Tiles(random)
    values = tiles.base(roughness=(0.4, 1.0))
    holder = tiles.extension("KHR_materials_transmission")
    values["transmission"] = tiles.factor(holder, "transmissionFactor", "transmissionTexture", 0, 0.1)
    if random.random() < 0.5:
        values["ior"] = tiles.factor(tiles.extension("KHR_materials_ior"), "ior", low=1.1, high=2)
    if number % 4 == 0:
        return lit(tiles, values)
    if number % 4 == 1:
        return lit_from_behind(tiles, values, Surface.transmitted)
    if number % 4 == 2:
        values["solid"] = True
        tiles.extension("KHR_materials_volume")["thicknessFactor"] = 1
        return lit_from_behind(tiles, values, Surface.transmitted)
    tiles.pbr["roughnessFactor"] = 0
    material = tiles.made_material()
    for tile in range(4):
        normal = drawn_direction(random, 75)
        tiles.surface(tile, normal, material)
        eta = values.get("ior", 1.5)
        share = (1 - values["metallic"]) * values["transmission"] * (1 - fresnel_equations(dot(normal, UP), eta))
        backdrop = Backdrop(tiles, tile)
        for pixel in pixels_of(tile):
            tiles.expect(pixel, [share * b * c for b, c in zip(values["base"], backdrop.seen(pixel))], ROUNDED)
    tiles.arguments += ["--passes", "refraction", "--environment", "0,0,0"]
    return tiles


class Backdrop:
    """Below a tile, colors that run across a plane."""

    def __init__(self, tiles, tile):
        self.tiles = tiles
        corners = [[x, y, 0] for x, y in ((-0.95, -0.95), (0.95, -0.95), (0.95, 0.95), (-0.95, 0.95))]
        random = tiles.random
        self.middle = drawn_color(random, 0.45, 0.55)
        self.slopes = [[random.uniform(-0.2, 0.2) for _ in range(2)] for _ in range(3)]
        colors = [self.at(x, y) for x, y, _ in corners]
        primitive = {"attributes": {"POSITION": tiles.positions(corners), "COLOR_0": tiles.accessor(colors)},
                     "indices": tiles.indices([(0, 1, 2), (0, 2, 3)]), "material": tiles.unlit()}
        self.x, self.y, z = tiles.center(tile)
        tiles.node(mesh=tiles.mesh(primitive), translation=[self.x, self.y, z - 5])

    def at(self, x, y):
        return [m + a * x + b * y for m, (a, b) in zip(self.middle, self.slopes)]

    def seen(self, pixel, moved=(0.0, 0.0)):
        x, y = self.tiles.center_of(pixel)
        return self.at(x - self.x + moved[0], y - self.y + moved[1])


def add_slab(tiles, tile, normal, thickness, material):
    """A closed box whose front goes through the tile's center."""
    side = normalized(cross((0.0, 1.0, 0.0), normal))
    up = cross(normal, side)
    corners = [plus(plus(scaled(side, a), scaled(up, b)), scaled(normal, c))
               for c in (0, -thickness) for a, b in ((-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9))]
    quads = [(0, 1, 2, 3), (7, 6, 5, 4)] + [(i, i + 4, (i + 1) % 4 + 4, (i + 1) % 4) for i in range(4)]
    triangles = flat([(a, b, c), (a, c, d)] for a, b, c, d in quads)
    primitive = {"attributes": {"POSITION": tiles.positions(corners)}, "indices": tiles.indices(triangles),
                 "material": material}
    tiles.node(mesh=tiles.mesh(primitive), translation=tiles.center(tile))


def glass(random, number, dispersion):
    """Clear slabs over backdrops: what goes through twice without a reflection on its way (`--max-depth 2`), moved aside as
    far as each channel's index bends it, and dimmed by the way within."""
    tiles = Tiles(random)
    values = tiles.base(metallic=False, color=(0.3, 1))
    tiles.pbr["roughnessFactor"] = 0
    tiles.extension("KHR_materials_transmission")["transmissionFactor"] = 1
    index = tiles.extension("KHR_materials_ior")["ior"] = as_float(random.uniform(1.05, 1.6 if dispersion else 2.2))
    volume = tiles.extension("KHR_materials_volume")
    volume["thicknessFactor"] = as_float(random.uniform(0.1, 3))
    left, metres = [1.0] * 3, 1.0
    if random.random() < 0.7:
        left = volume["attenuationColor"] = drawn_color(random, 0.2)
        metres = volume["attenuationDistance"] = as_float(random.uniform(0.1, 1))
    if not dispersion and number % 3 == 0:
        index = tiles.parts["KHR_materials_ior"]["ior"] = 1.0
    spread = 0.0
    if dispersion:
        # 20 over the Abbe number.
        spread = tiles.factor(tiles.extension("KHR_materials_dispersion"), "dispersion", low=0.5, high=8) * (index - 1) / 40
    material = tiles.made_material()
    for tile in range(4):
        normal = drawn_direction(random, 40, 5)  # its mirror images lie beside the other tiles
        thickness = as_float(random.uniform(0.1, 0.3))
        add_slab(tiles, tile, normal, thickness, material)
        backdrop = Backdrop(tiles, tile)
        cosine = dot(normal, UP)
        sine = math.sqrt(1 - cosine * cosine)
        for pixel in pixels_of(tile):
            color = []
            for c, n in enumerate((index - spread, index, index + spread)):
                n = max(n, 1.0)
                inside = math.sqrt(1 - (sine / n) ** 2)
                way = thickness / inside
                # Refraction turns it against the normal.
                moved = scaled(normal[:2], way * (cosine / n - inside))
                share = (1 - fresnel_equations(cosine, n)) ** 2 * values["base"][c] * left[c] ** (way / metres)
                color.append(share * backdrop.seen(pixel, moved)[c])
            tiles.expect(pixel, color, ROUNDED)
    tiles.arguments += ["--passes", "reflection,refraction", "--max-depth", "2", "--environment", "0,0,0"]
    return tiles


def dispersion(random, number):
    return glass(random, number, True)


def volume(random, number):
    return glass(random, number, False)


def punctual(random, number):
    """Points, spots and suns, with ranges, by distance and angle, on a rough dielectric."""
    tiles = Tiles(random)
    values = tiles.base(roughness=(0.5, 1))
    material = tiles.made_material()
    normals = [drawn_direction(random, 50) for _ in range(4)]
    for tile, normal in enumerate(normals):
        tiles.surface(tile, normal, material)
    lamps = []
    for i in range(2 + number % 3):
        color, strength = drawn_color(random, 0.2), as_float(random.uniform(1, 30))
        fields = {"type": ("point", "spot", "directional")[(number + i) % 3], "color": color, "intensity": strength}
        tile = random.randrange(4)
        position = plus(tiles.center(tile), scaled(drawn_direction(random, 70), random.uniform(1, 4)))
        position = tuple(map(as_float, position))
        axis = drawn_direction(random, 60, about=(0.0, 0.0, 1.0))  # against which it shines
        if fields["type"] == "spot":
            outer = as_float(random.uniform(0.3, 1.5))
            fields["spot"] = {"outerConeAngle": outer, "innerConeAngle": as_float(random.uniform(0, outer * 0.95))}
        if fields["type"] != "directional" and random.random() < 0.6:
            fields["range"] = as_float(random.uniform(3, 12))
        x, y, z = axis
        length = math.sqrt(2 + 2 * z)
        tiles.light(fields, translation=list(position), rotation=[-y / length, x / length, 0.0, (1 + z) / length])
        lamps.append((fields, position, axis))
    for tile, normal in enumerate(normals):
        surface = Surface(UP, normal, **values)
        for pixel in pixels_of(tile):
            x, y = tiles.center_of(pixel)
            cx, cy, cz = tiles.center(tile)
            position_seen = (x, y, cz - (normal[0] * (x - cx) + normal[1] * (y - cy)) / normal[2])
            color = [0.0] * 3
            for fields, position, axis in lamps:
                toward, strength = lamp_at(fields, position, axis, position_seen)
                if dot(toward, normal) > 1e-9:
                    color = [c + strength * f * e for c, f, e in zip(color, surface.reflected(toward), fields["color"])]
            tiles.expect(pixel, color, ROUNDED)
    tiles.arguments += ["--passes", "none"]
    return tiles


def lamp_at(fields, position, axis, lit_position):
    """The direction to a light, and how much falls on what faces it there."""
    if fields["type"] == "directional":
        return axis, fields["intensity"]
    way = plus(position, scaled(lit_position, -1))
    metres = math.sqrt(dot(way, way))
    toward = scaled(way, 1 / metres)
    strength = fields["intensity"] / metres ** 2
    if "range" in fields:
        strength *= min(max(1 - (metres / fields["range"]) ** 4, 0), 1)
    if fields["type"] == "spot":
        inner, outer = (math.cos(fields["spot"][name]) for name in ("innerConeAngle", "outerConeAngle"))
        ramp = (dot(toward, axis) - outer) / max(0.001, inner - outer)
        strength *= min(max(ramp, 0), 1) ** 2
    return toward, strength


KINDS = {"KHR_materials_specular": specular, "KHR_materials_ior": ior, "KHR_materials_clearcoat": clearcoat,
         "KHR_materials_sheen": sheen, "KHR_materials_anisotropy": anisotropy, "KHR_materials_iridescence": iridescence,
         "KHR_materials_emissive_strength": emissive_strength, "KHR_materials_unlit": unlit,
         "KHR_materials_diffuse_transmission": diffuse_transmission, "KHR_materials_transmission": transmission,
         "KHR_materials_volume": volume, "KHR_materials_dispersion": dispersion, "KHR_lights_punctual": punctual}
