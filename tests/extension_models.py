"""glTF files of every extension that HPR reads, with drawn parameters, and the pixels that they must give.

A Model is a file, how hpr is to draw it, and the values that the specifications make of its pixels, computed here in
double precision and held to 2e-5 (1e-4 of textures): what a file's 32 bits make of positions and colors. The view is orthographic, from z = 500 down; a sample is a pixel's center. KINDS names the kinds of
files, extension_materials.py has those of materials.
"""

import base64
import itertools
import json
import math
import struct

import png
from extension_encoders import draco_sequential, meshopt_attributes, meshopt_indices, meshopt_triangles, webp
from extension_formulas import dot, mix, normalized, plus, scaled

HALF_VIEW = 2.0  # world units from the picture's middle to its edges
EYE_HEIGHT = 500.0

FLOAT, USHORT, UINT, UBYTE, SHORT, BYTE = 5126, 5123, 5125, 5121, 5122, 5120
LETTERS = {FLOAT: "f", USHORT: "H", UINT: "I", UBYTE: "B", SHORT: "h", BYTE: "b"}
TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


def flat(rows):
    return list(itertools.chain(*rows))


def as_float(value):
    """As a file's 32 bits hold it."""
    return struct.unpack("<f", struct.pack("<f", value))[0]


def packed_png(width, height, values):
    """RGBA, row by row."""
    return png.encode(width, height, bytes(values))


def srgb_to_linear(level):
    value = level / 255
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


class Model:
    """A document that grows around one buffer, and what its picture must show."""

    def __init__(self, size=8):
        self.size = size
        self.data = b""
        self.files = {}  # beside the document
        self.arguments = []
        self.expected = []  # ((column, row), [r, g, b], relative tolerance, absolute tolerance)
        self.exit_code, self.message = 0, ""  # what stderr must hold
        self.used = set()
        self.gltf = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}], "nodes": [], "meshes": [],
                     "accessors": [], "bufferViews": [], "cameras": [{"type": "orthographic", "orthographic": {
                         "xmag": HALF_VIEW, "ymag": HALF_VIEW, "znear": 1, "zfar": 2 * EYE_HEIGHT}}]}
        self.node(camera=0, translation=[0, 0, EYE_HEIGHT])

    def add(self, section, entry):
        self.gltf.setdefault(section, []).append(entry)
        return len(self.gltf[section]) - 1

    def view(self, packed, **fields):
        """Bytes of the buffer, aligned to four."""
        self.data += b"\0" * (-len(self.data) % 4)
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(packed)} | fields
        self.data += packed
        return self.add("bufferViews", view)

    def accessor(self, rows, component=FLOAT, view=None, **fields):
        """Rows of numbers; `view`: that which holds them already, by -1 none at all."""
        width = len(rows[0])
        entry = {"componentType": component, "count": len(rows), "type": TYPES[width]} | fields
        if view is None:
            stride = -struct.calcsize(f"<{width}{LETTERS[component]}") % 4
            packed = b"".join(struct.pack(f"<{width}{LETTERS[component]}", *row) + b"\0" * stride for row in rows)
            view = self.view(packed, **({"byteStride": len(packed) // len(rows)} if stride else {}))
        if view >= 0:
            entry["bufferView"] = view
        return self.add("accessors", entry)

    def positions(self, rows, component=FLOAT, **fields):
        rows = [[as_float(x) for x in row] for row in rows] if component == FLOAT else rows
        bounds = {"min": [min(axis) for axis in zip(*rows)], "max": [max(axis) for axis in zip(*rows)]}
        return self.accessor(rows, component, **bounds, **fields)

    def indices(self, triangles):
        return self.accessor([[corner] for corner in flat(triangles)], USHORT)

    def mesh(self, primitive):
        return self.add("meshes", {"primitives": [primitive]})

    def node(self, parent=None, **fields):
        made = self.add("nodes", fields)
        holder = self.gltf["scenes"][0]["nodes"] if parent is None else self.gltf["nodes"][parent].setdefault("children", [])
        holder.append(made)
        return made

    def use(self, *names):
        self.used.update(names)

    def require(self, name):
        self.use(name)
        self.gltf["extensionsRequired"] = [name]

    def material(self, extensions=None, pbr=None, **fields):
        if extensions:
            fields["extensions"] = extensions
            self.use(*extensions)
        return self.add("materials", {"pbrMetallicRoughness": {"metallicFactor": 0} | (pbr or {})} | fields)

    def unlit(self, color=(1, 1, 1, 1), **fields):
        return self.material({"KHR_materials_unlit": {}}, {"baseColorFactor": list(color)} | fields.pop("pbr", {}),
                             doubleSided=True, **fields)

    def picture(self, packed, kind="image/png"):
        return self.add("images", {"bufferView": self.view(packed), "mimeType": kind})

    def texel(self, rgba):
        """A texture of one texel."""
        return self.add("textures", {"source": self.picture(packed_png(1, 1, rgba))})

    def light(self, fields, **transform):
        holder = self.gltf.setdefault("extensions", {}).setdefault("KHR_lights_punctual", {"lights": []})
        holder["lights"].append(fields)
        self.use("KHR_lights_punctual")
        return self.node(extensions={"KHR_lights_punctual": {"light": len(holder["lights"]) - 1}}, **transform)

    def expect(self, pixel, color, relative=2e-5, absolute=1e-6):
        self.expected.append((pixel, list(color), relative, absolute))

    def center_of(self, pixel):
        """In the plane of the view."""
        step = 2 * HALF_VIEW / self.size
        return (pixel[0] + 0.5) * step - HALF_VIEW, HALF_VIEW - (pixel[1] + 0.5) * step

    def pixels(self):
        return itertools.product(range(self.size), range(self.size))

    def document(self, data_uri=None):
        """The JSON text."""
        if self.used:
            self.gltf["extensionsUsed"] = sorted(self.used | set(self.gltf.get("extensionsUsed", [])))
        if data_uri is None:
            data_uri = "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
        buffers = [{"byteLength": len(self.data), "uri": data_uri}] if self.data else []
        kept = {name: part for name, part in self.gltf.items() if part != [] or name == "scenes"}
        return json.dumps(kept | ({"buffers": self.gltf.get("buffers", buffers)} if self.data else {}))

    def write(self, path):
        for name, packed in self.files.items():
            (path.parent / name).parent.mkdir(parents=True, exist_ok=True)
            (path.parent / name).write_bytes(packed)
        path.write_text(self.document())


# Triangles as they are seen, by hand: every pixel's center against every triangle.

class Corner:
    def __init__(self, position, *values):
        self.position, self.values = position, values  # world; what is interpolated


def expect_triangles(model, triangles, shade, relative=2e-5, absolute=2e-6):
    """`triangles`: of Corners. Pixels whose centers lie next to an edge, where two triangles lie at one depth, or for which
    `shade` has no color are not looked at."""
    seen = 0
    for pixel in model.pixels():
        x, y = model.center_of(pixel)
        nearest, second, doubtful = None, -math.inf, False
        for triangle in triangles:
            (x0, y0, z0), (x1, y1, z1), (x2, y2, z2) = (corner.position for corner in triangle)
            area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
            if abs(area) < 1e-4:
                doubtful = doubtful or abs(area) > 1e-9
                continue
            b = ((x - x0) * (y2 - y0) - (x2 - x0) * (y - y0)) / area
            c = ((x1 - x0) * (y - y0) - (x - x0) * (y1 - y0)) / area
            shares = (1 - b - c, b, c)
            doubtful = doubtful or -2e-3 < min(shares) < 2e-3
            if min(shares) < 0:
                continue
            depth = dot(shares, (z0, z1, z2))
            if nearest is None or depth > nearest[0]:
                second = nearest[0] if nearest else -math.inf
                nearest = (depth, triangle, shares)
            else:
                second = max(second, depth)
        if doubtful or (nearest and nearest[0] - second < 1e-3):
            continue
        if nearest is None:
            model.expect(pixel, [0.0] * 3, relative, absolute)
            continue
        seen += 1
        _, triangle, shares = nearest
        values = [[dot(shares, parts) for parts in zip(*kinds)] for kinds in zip(*(corner.values for corner in triangle))]
        color = shade(*values)
        if color is not None:
            model.expect(pixel, color, relative, absolute)
    return seen


def drawn_mesh(random, rows=3, low=-1.8, high=1.8):
    """Vertices on a shaken grid that faces +z, colors, and triangles over its cells with some left out."""
    step = (high - low) / rows
    positions = [[as_float(low + (i % (rows + 1) + random.uniform(-0.25, 0.25)) * step),
                  as_float(low + (i // (rows + 1) + random.uniform(-0.25, 0.25)) * step),
                  as_float(random.uniform(-1, 1))] for i in range((rows + 1) ** 2)]
    colors = [[as_float(random.uniform(0.05, 1)) for _ in range(3)] for _ in positions]
    triangles = []
    for i, j in itertools.product(range(rows), range(rows)):
        a = i * (rows + 1) + j
        for triangle in ((a, a + 1, a + rows + 2), (a, a + rows + 2, a + rows + 1)):
            if not triangles or random.random() < 0.85:
                triangles.append(triangle)
    return positions, colors, triangles


def placed(positions, colors, triangles, transform=lambda p: p):
    corners = [Corner(transform(p), color) for p, color in zip(positions, colors)]
    return [[corners[i] for i in triangle] for triangle in triangles]


def rotated(quaternion, v):
    x, y, z, w = quaternion
    axis = (x, y, z)
    doubled = scaled((y * v[2] - z * v[1], z * v[0] - x * v[2], x * v[1] - y * v[0]), 2)
    turned = (axis[1] * doubled[2] - axis[2] * doubled[1], axis[2] * doubled[0] - axis[0] * doubled[2],
              axis[0] * doubled[1] - axis[1] * doubled[0])
    return tuple(a + w * b + c for a, b, c in zip(v, doubled, turned))


def drawn_rotation(random, max_degrees=180.0):
    half = math.radians(random.uniform(0, max_degrees)) / 2
    axis = normalized([random.gauss(0, 1) for _ in range(3)])
    return [as_float(x) for x in (*scaled(axis, math.sin(half)), math.cos(half))]


def drawn_transform(random, spread=0.8, max_degrees=180.0):
    """Fields of a node, and the function that they are."""
    translation = [as_float(random.uniform(-spread, spread)) for _ in range(3)]
    rotation = drawn_rotation(random, max_degrees)
    scale = [as_float(random.uniform(0.4, 1.1)) for _ in range(3)]
    length = math.sqrt(dot(rotation, rotation))
    unit = [x / length for x in rotation]

    def transform(p):
        return plus(rotated(unit, tuple(a * b for a, b in zip(p, scale))), translation)
    return {"translation": translation, "rotation": rotation, "scale": scale}, transform


def colored_primitive(model, positions, colors, triangles, material=None):
    material = model.unlit() if material is None else material
    return {"attributes": {"POSITION": model.positions(positions), "COLOR_0": model.accessor(colors)},
            "indices": model.indices(triangles), "material": material}


def plain_model(random):
    model = Model(16)
    mesh = drawn_mesh(random)
    model.node(mesh=model.mesh(colored_primitive(model, *mesh)))
    expect_triangles(model, placed(*mesh), lambda color: color)
    return model


# Files.

def data_uris(random, number):
    """Base64 with an upper-case scheme, percent escapes for base64 and for bytes, and files with escapes in their names."""
    model = plain_model(random)
    text = base64.b64encode(model.data).decode()
    escaped = "".join(f"%{ord(c):02X}" if random.random() < 0.2 or c in "+/=" else c for c in text)
    raw = "".join(f"%{b:02x}" if random.random() < 0.7 or not chr(b).isalnum() or b > 127 else chr(b) for b in model.data)
    uri = ("DATA:application/octet-stream;base64," + text, "data:application/gltf-buffer;BASE64," + text,
           "Data:;Base64," + escaped, "data:application/octet-stream," + raw, "a%20b/%C3%A9%2520.bin")[number % 5]
    if number % 5 == 4:
        model.files["a b/\u00e9%20.bin"] = model.data
    model.gltf["buffers"] = [{"byteLength": len(model.data), "uri": uri}]
    return model


def quantization(random, number):
    """Positions and colors of few bits, whose node brings them back to size."""
    model = Model(16)
    model.use("KHR_mesh_quantization")
    component, normalized_integers = [(BYTE, True), (BYTE, False), (UBYTE, True), (UBYTE, False), (SHORT, True),
                                      (SHORT, False), (USHORT, True), (USHORT, False)][number % 8]
    low, high = {BYTE: (-127, 127), UBYTE: (0, 255), SHORT: (-32767, 32767), USHORT: (0, 65535)}[component]
    positions, colors, triangles = drawn_mesh(random)
    bits = [[round(low + (x + 2.5) / 5 * (high - low)) for x in row] for row in positions]
    unit = high if normalized_integers else 1
    scale = as_float(5 / (high - low) * unit)
    offset = as_float(-2.5 - low / unit * scale)
    color_bits = [[round(255 * x) for x in row] for row in colors]
    primitive = {"attributes": {"POSITION": model.positions(bits, component, normalized=normalized_integers),
                                "COLOR_0": model.accessor(color_bits, UBYTE, normalized=True)},
                 "indices": model.indices(triangles), "material": model.unlit()}
    model.require("KHR_mesh_quantization")
    model.node(mesh=model.mesh(primitive), scale=[scale] * 3, translation=[offset] * 3)
    world = [[x / unit * scale + offset for x in row] for row in bits]
    expect_triangles(model, placed(world, [[x / 255 for x in row] for row in color_bits], triangles), lambda color: color)
    return model


def instancing(random, number):
    """Each instance's transform before the node's."""
    model = Model(16)
    positions, colors, triangles = drawn_mesh(random, 2, -0.7, 0.7)
    fields, outer = drawn_transform(random, 0.3, 40)
    count = 2 + number % 4
    inner = [drawn_transform(random, 1.4, 60) for _ in range(count)]
    attributes, seen = {}, []
    for name, key in (("TRANSLATION", "translation"), ("ROTATION", "rotation"), ("SCALE", "scale")):
        if number % 7 != 6 or key == "translation":
            attributes[name] = model.accessor([made[key] for made, _ in inner])
    for made, transform in inner:
        moved = transform if number % 7 != 6 else (lambda p, by=made["translation"]: plus(p, by))
        seen += placed(positions, colors, triangles, lambda p, moved=moved: outer(moved(p)))
    model.require("EXT_mesh_gpu_instancing")
    model.node(mesh=model.mesh(colored_primitive(model, positions, colors, triangles)), **fields,
               extensions={"EXT_mesh_gpu_instancing": {"attributes": attributes}})
    expect_triangles(model, seen, lambda color: color)
    return model


def skinning(random, number):
    """Five to eight joints a vertex, in JOINTS_0 and JOINTS_1, that turn and grow."""
    model = Model(16)
    positions, colors, triangles = drawn_mesh(random)
    joints, count = 8, 5 + number % 4
    moves = [drawn_transform(random, 0.3, 25) for _ in range(joints)]
    binds = [[as_float(random.uniform(-0.3, 0.3)) for _ in range(3)] for _ in range(joints)]
    weights, chosen = [], []
    for _ in positions:
        chosen.append(random.sample(range(joints), count) + [0] * (8 - count))
        shares = [random.uniform(0.1, 1) for _ in range(count)]
        weights.append([as_float(share / sum(shares)) for share in shares] + [0.0] * (8 - count))
    primitive = colored_primitive(model, positions, colors, triangles)
    for half in range(2):
        part = slice(4 * half, 4 * half + 4)
        primitive["attributes"][f"JOINTS_{half}"] = model.accessor([row[part] for row in chosen], UBYTE)
        primitive["attributes"][f"WEIGHTS_{half}"] = model.accessor([row[part] for row in weights])
    nodes = [model.node(**fields) for fields, _ in moves]
    matrices = [[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, *bind, 1] for bind in binds]
    model.gltf["skins"] = [{"joints": nodes, "inverseBindMatrices": model.accessor(matrices)}]
    model.node(mesh=model.mesh(primitive), skin=0, translation=[50, 0, 0])  # a skin's node moves nothing

    def skinned(i, position):
        total = sum(weights[i])
        moved = [scaled(moves[joint][1](plus(position, binds[joint])), weight / total)
                 for joint, weight in zip(chosen[i], weights[i])]
        return tuple(map(sum, zip(*moved)))
    world = [skinned(i, position) for i, position in enumerate(positions)]
    expect_triangles(model, placed(world, colors, triangles), lambda color: color)
    return model


def variants(random, number):
    """Several meshes, some without a material in the chosen variant."""
    model = Model(16)
    names = [f"variant {i}" for i in range(2 + number % 3)]
    chosen = random.randrange(-1, len(names))
    colors = [[as_float(random.uniform(0.05, 1)) for _ in range(3)] for _ in range(6)]
    materials = [model.unlit((*color, 1)) for color in colors]
    model.use("KHR_materials_variants")
    model.gltf.setdefault("extensions", {})["KHR_materials_variants"] = {"variants": [{"name": name} for name in names]}
    seen = []
    for quarter in range(4):
        x, y = 2 * (quarter % 2) - 1, 2 * (quarter // 2) - 1
        positions = [[x - 0.9, y - 0.9, 0], [x + 0.9, y - 0.9, 0], [x + 0.9, y + 0.9, 0], [x - 0.9, y + 0.9, 0]]
        triangles = [(0, 1, 2), (0, 2, 3)]
        own = random.randrange(6)
        free = list(range(len(names)))
        random.shuffle(free)
        mappings = []
        while free and random.random() < 0.8:
            several = [free.pop() for _ in range(min(len(free), 1 + random.randrange(2)))]
            mappings.append({"variants": several, "material": random.randrange(6)})
        primitive = {"attributes": {"POSITION": model.positions(positions)}, "indices": model.indices(triangles),
                     "material": materials[own]}
        if mappings:
            primitive["extensions"] = {"KHR_materials_variants": {"mappings": mappings}}
        model.node(mesh=model.mesh(primitive))
        shown = next((m["material"] for m in mappings if chosen in m["variants"]), own)
        seen += placed(positions, [colors[shown]] * 4, triangles)
    if chosen >= 0:
        model.arguments += ["--variant", names[chosen]]
    expect_triangles(model, seen, lambda color: color)
    return model


def visibility(random, number):
    """A tree of nodes, some of them hidden with all below."""
    model = Model(16)
    model.use("KHR_node_visibility")
    seen, nodes = [], [(None, True, lambda p: p)]
    for _ in range(6):
        parent, shown, outer = random.choice(nodes)
        fields, inner = drawn_transform(random, 0.5, 30)
        visible = random.random() < 0.7
        if not visible or random.random() < 0.5:
            fields["extensions"] = {"KHR_node_visibility": {"visible": visible} if not visible or number % 2 else {}}
        mesh = drawn_mesh(random, 2, -0.8, 0.8)
        node = model.node(parent, mesh=model.mesh(colored_primitive(model, *mesh)), **fields)

        def transform(p, outer=outer, inner=inner):
            return outer(inner(p))
        nodes.append((node, shown and visible, transform))
        if shown and visible:
            seen += placed(*mesh, transform)
    expect_triangles(model, seen, lambda color: color)
    return model


def min_version(random, number):
    """2.0 is drawn, all above is refused."""
    model = plain_model(random)
    version = ["2.0", "2.1", "3.0", "2.0", "2.10", "10.0"][number % 6]
    model.gltf["asset"] = {"version": "2.9" if version == "2.0" and number % 2 else "2.0", "minVersion": version}
    if version != "2.0":
        model.gltf["asset"]["version"] = version if random.random() < 0.5 else "12.0"
        model.exit_code, model.message, model.expected = 3, "minVersion", []
    return model


# Textures.

def drawn_picture(random, max_side=6):
    width, height = random.randint(1, max_side), random.randint(1, max_side)
    return width, height, [random.randint(0, 255) for _ in range(4 * width * height)]


REPEAT, CLAMP, MIRROR = 10497, 33071, 33648


def texel_at(picture, sampler, column, row):
    width, height, values = picture

    def wrapped(index, count, wrap):
        if wrap == CLAMP:
            return min(max(index, 0), count - 1)
        period = index % (2 * count if wrap == MIRROR else count)
        return 2 * count - 1 - period if period >= count else period
    at = 4 * (wrapped(row, height, sampler["wrapT"]) * width + wrapped(column, width, sampler["wrapS"]))
    return [srgb_to_linear(level) for level in values[at:at + 3]]


def sampled(picture, sampler, u, v):
    """Colors are decoded before they are mixed."""
    x, y = u * picture[0], v * picture[1]
    if sampler["magFilter"] == 9728:
        return texel_at(picture, sampler, math.floor(x), math.floor(y))
    column, row = math.floor(x - 0.5), math.floor(y - 0.5)
    rows = [mix(texel_at(picture, sampler, column, r), texel_at(picture, sampler, column + 1, r), x - 0.5 - column)
            for r in (row, row + 1)]
    return mix(*rows, y - 0.5 - row)


def textured(random, add_texture, info=None, uv_of=lambda uv: uv):
    """A quad with a drawn texture, whose coordinates `info` (of the material's reference) changes by `uv_of`."""
    model = Model(16)
    picture = drawn_picture(random)
    sampler = {"magFilter": random.choice([9728, 9729]), "wrapS": random.choice([REPEAT, CLAMP, MIRROR]),
               "wrapT": random.choice([REPEAT, CLAMP, MIRROR])}
    model.gltf["samplers"] = [sampler]
    texture = add_texture(model, picture)
    positions = [[-1.9, -1.9, 0], [1.9, -1.9, 0], [1.9, 1.9, 0], [-1.9, 1.9, 0]]
    uvs = [[as_float(random.uniform(-1, 2)) for _ in range(2)] for _ in positions]
    material = model.unlit(pbr={"baseColorTexture": {"index": texture} | (info or {})})
    primitive = {"attributes": {"POSITION": model.positions(positions), "TEXCOORD_0": model.accessor(uvs)},
                 "indices": model.indices([(0, 1, 2), (0, 2, 3)]), "material": material}
    model.node(mesh=model.mesh(primitive))
    corners = [Corner(p, uv) for p, uv in zip(positions, uvs)]

    def shade(uv):
        u, v = uv_of(uv)
        if sampler["magFilter"] == 9728 and any(abs(t * n - round(t * n)) < 1e-4 for t, n in zip((u, v), picture)):
            return None  # on the border of two texels
        return sampled(picture, sampler, u, v)
    expect_triangles(model, [[corners[i] for i in t] for t in ((0, 1, 2), (0, 2, 3))], shade, 1e-4, 1e-4)
    return model


def plain_texture(model, picture):
    return model.add("textures", {"source": model.picture(packed_png(*picture)), "sampler": 0})


def texture_transform(random, number):
    transform = {}
    offset, scale, rotation = (0.0, 0.0), (1.0, 1.0), 0.0
    if number % 4 != 1:
        offset = transform["offset"] = [as_float(random.uniform(-1, 1)) for _ in range(2)]
    if number % 4 != 2:
        scale = transform["scale"] = [as_float(random.uniform(-2, 2)) for _ in range(2)]
    if number % 4 != 3:
        rotation = transform["rotation"] = as_float(random.uniform(-4, 4))
    if number % 5 == 0:
        transform["texCoord"] = 0
    c, s = math.cos(rotation), math.sin(rotation)

    def uv_of(uv):
        u, v = uv[0] * scale[0], uv[1] * scale[1]
        return c * u + s * v + offset[0], -s * u + c * v + offset[1]
    info = {"extensions": {"KHR_texture_transform": transform}}
    if number % 5 == 0:
        info["texCoord"] = 1  # the transform's own counts
    model = textured(random, plain_texture, info, uv_of)
    model.use("KHR_texture_transform")
    return model


def webp_texture(random, number):
    """Beside another picture or alone."""
    def add_texture(model, picture):
        width, height, values = picture
        texture = {"sampler": 0, "extensions": {"EXT_texture_webp": {
            "source": model.picture(webp(width, height, values), "image/webp")}}}
        if number % 2:
            texture["source"] = model.picture(packed_png(*drawn_picture(random)))
        else:
            model.require("EXT_texture_webp")
        return model.add("textures", texture)
    model = textured(random, add_texture)
    model.use("EXT_texture_webp")
    return model


def basisu(random, number):
    """A KTX 2 picture: what stands beside it is drawn with a warning, without it the file is refused."""
    def add_texture(model, picture):
        ktx = model.picture(b"\xABKTX 20\xBB\r\n\x1A\n" + bytes(68), "image/ktx2")
        texture = {"sampler": 0, "extensions": {"KHR_texture_basisu": {"source": ktx}}}
        if number % 2:
            texture["source"] = model.picture(packed_png(*picture))
        return model.add("textures", texture)
    model = textured(random, add_texture)
    model.use("KHR_texture_basisu")
    if number % 4 == 0:
        model.require("KHR_texture_basisu")
    if number % 2:
        model.message = "drawn with the one beside it"
    else:
        model.exit_code, model.message, model.expected = 3, "ktxdecompress", []
    return model


# Compressed meshes: as their encoders leave them.

def meshopt(random, number):
    model = Model(16)
    model.require("EXT_meshopt_compression")
    positions, colors, triangles = drawn_mesh(random, 3 + number % 3)
    fallback = [0]

    def compressed(packed, count, stride, mode):
        """A view of the second buffer, which has no bytes."""
        view = model.view(packed)
        entry = model.gltf["bufferViews"][view]
        entry["extensions"] = {"EXT_meshopt_compression": {
            "buffer": 0, "byteOffset": entry["byteOffset"], "byteLength": len(packed), "byteStride": stride, "count": count,
            "mode": mode}}
        entry |= {"buffer": 1, "byteOffset": fallback[0], "byteLength": count * stride}
        if mode == "ATTRIBUTES":
            entry["byteStride"] = stride
        fallback[0] += count * stride
        return view
    rows = [struct.pack("<3f", *p) for p in positions]
    color_rows = [struct.pack("<3f", *c) for c in colors]
    flat_indices = flat(triangles)
    if number % 2:
        packed, mode = meshopt_triangles(flat_indices), "TRIANGLES"
    else:
        packed, mode = meshopt_indices(flat_indices), "INDICES"
    primitive = {"attributes": {
        "POSITION": model.positions(positions, view=compressed(meshopt_attributes(rows), len(rows), 12, "ATTRIBUTES")),
        "COLOR_0": model.accessor(colors, view=compressed(meshopt_attributes(color_rows), len(rows), 12, "ATTRIBUTES"))},
        "indices": model.accessor([[i] for i in flat_indices], USHORT, view=compressed(packed, len(flat_indices), 2, mode)),
        "material": model.unlit()}
    model.node(mesh=model.mesh(primitive))
    uri = "data:application/octet-stream;base64," + base64.b64encode(model.data).decode()
    model.gltf["buffers"] = [{"byteLength": len(model.data), "uri": uri},
                             {"byteLength": fallback[0], "extensions": {"EXT_meshopt_compression": {"fallback": True}}}]
    expect_triangles(model, placed(positions, colors, triangles), lambda color: color)
    return model


def draco(random, number):
    model = Model(16)
    model.require("KHR_draco_mesh_compression")
    positions, colors, triangles = drawn_mesh(random, 2 + number % 4)
    float32, position, color = 9, 0, 2
    packed = draco_sequential(triangles, [(position, float32, positions, "f"), (color, float32, colors, "f")])
    primitive = {"attributes": {"POSITION": model.positions(positions, view=-1), "COLOR_0": model.accessor(colors, view=-1)},
                 "indices": model.accessor([[i] for i in flat(triangles)], USHORT, view=-1), "material": model.unlit(),
                 "extensions": {"KHR_draco_mesh_compression": {"bufferView": model.view(packed),
                                                               "attributes": {"POSITION": 0, "COLOR_0": 1}}}}
    model.node(mesh=model.mesh(primitive))
    expect_triangles(model, placed(positions, colors, triangles), lambda color: color)
    return model


KINDS = {"data URIs": data_uris, "KHR_mesh_quantization": quantization, "EXT_mesh_gpu_instancing": instancing,
         "JOINTS_1": skinning, "KHR_materials_variants": variants, "KHR_node_visibility": visibility,
         "minVersion": min_version, "KHR_texture_transform": texture_transform, "EXT_texture_webp": webp_texture,
         "KHR_texture_basisu": basisu, "EXT_meshopt_compression": meshopt, "KHR_draco_mesh_compression": draco}
