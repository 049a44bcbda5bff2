#!/usr/bin/env python3
"""Holds the language of the sources: no identifier of a private dialect, no doc comment that leans on the one before.

usage: check_names.py [--self-test] ROOT

Every identifier in the code (not in comments or strings) of the folders in ROOMS is compared with DENIED, every doc
comment with LEANING. Prints one line per breach, `file:line: NAME: say TERM`, and leaves with 1.
"""

import pathlib
import re
import sys

ROOMS = ["core", "image", "scene", "cluster", "raster", "compositing", "rt", "walls", "engine", "app", "tools", "bench", "tests", "gpu"]

# A pattern of whole identifiers (without a trailing _) -> the term of the field's literature that stands instead.
DENIED = [
    # Limits.
    (r"kMost\w*|kLongest\w*|kLargest\w*|kFarthest\w*|kFurthest\w*|kHighest\w*", "kMax..."),
    (r"kLeast\w*|kFewest\w*|kSmallest\w*|kShortest\w*|kLowest\w*", "kMin..."),
    # Filters: Eisemann and Durand 2004; Kopf et al. 2007.
    (r"lenders?|Lenders?", "neighbor tap"),
    (r"borrowers?|borrows?|Borrowers?", "center (of a joint bilateral filter)"),
    (r"weigh_lenders", "joint_bilateral_weights"),
    (r"LenderSights?", "NeighborFeatures"),
    (r"SharedLight", "HalfResShading"),
    (r"Lent", "FilterLobe"),
    (r"is_split", "separate_diffuse"),
    # The G-buffer and its samples.
    (r"Sights?|Seen", "SurfaceFeature"),
    (r"sight_of", "feature_at"),
    (r"is_near", "within_depth"),
    (r"is_beside", "coplanar"),
    (r"Looks?", "SubpixelSample"),
    (r"FrameLooks?", "JitteredViews"),
    (r"PixelParts?|PartFinder", "CoverageFragments"),
    (r"TileOutlines?", "silhouette edges"),
    # Surfaces and paths.
    (r"matte|Matte", "diffuse"),
    (r"mirrored", "specular (light) or reflected (geometry)"),
    (r"PathPoints?", "PathVertex"),
    (r"Waves?", "Wavefront"),
    (r"survival", "russian_roulette_weight"),
    (r"LightSets?", "LightSampler"),
    (r"even_sky|is_even", "constant environment"),
    (r"Lighter", "Shader or DeferredShading"),
    (r"LitSamples?", "ShadedSample"),
    (r"PhotonSender|send_photons", "PhotonTracer, trace_photons"),
    (r"flux_scatter", "radiance-estimate kernel"),
    (r"RayWalk", "CoverageTraversal"),
    (r"holed|is_holed", "alpha-tested"),
    (r"TravellingRays?", "RayForwarding"),
    (r"strangers?", "remote"),
    (r"TileHomes?", "TileOwnership"),
    (r"follows_the_rest", "gathers_all_lobes"),
    # Budgets and settings.
    (r"economies|economy|Economies", "degradations"),
    (r"took", "record_frame_time (verb), elapsed (time)"),
    (r"Knobs?", "Setting"),
    (r"on_the_way", "output_only"),
    # Messages: MPI.
    (r"given", "sent"),
    (r"taken", "received"),
    (r"Deeds?", "TraceEvent"),
    (r"Gatherings?", "Barrier"),
    (r"Tickets?", "MessageId"),
    (r"bodies", "segments (of a payload)"),
    # Metaphors of speech.
    (r"told|told_\w+|\w+_told", "notified, reported"),
    (r"tell|tell_\w+|tells", "report, notify"),
    (r"hear|hears|heard|hear_\w+|hearing|hearings?", "receive, poll_input"),
    (r"obey\w*", "apply"),
    (r"attend|attends", "poll"),
    (r"forgivable", "recoverable"),
    # Displays and files.
    (r"ScanOut", "PanelTransform"),
    (r"gltf_look|GltfLook", "materials"),
    (r"gltf_eyes_and_lights", "cameras_lights"),
    (r"gltf_shape", "schema_check"),
    (r"gltf_data", "accessors"),
    (r"point_map\w*|PointMap", "position_map, PositionMap"),
    # Everyday words.
    (r"ways?", "direction, path, transform"),
    (r"places?|SurfacePlace", "position, index, location"),
    (r"middles?", "center, centroid, midpoint"),
    (r"shares?", "fraction, part, count"),
    (r"so_far", "distance, sum, total"),
]
# Words that are verbs of the field too: functions may have these names.
VERBS = {"place", "share"}

DENIED = [(re.compile(pattern), term) for pattern, term in DENIED]

# How a doc comment must not begin: it says nothing without the one before.
LEANING = re.compile(r"///<?\s+(The same|Same|[Ll]ikewise|Of that|Of those|All of (?:that|those)|[Aa]s above|Ditto|See above)\b")

IDENTIFIER = re.compile(r"[A-Za-z_]\w*")
SOURCES = {".h", ".cpp"}
# Comments, strings and characters: what is blanked before identifiers are looked for, line ends kept.
NO_CODE = re.compile(
    r'//[^\n]*|/\*.*?\*/|R"(?P<mark>[^(\s]*)\(.*?\)(?P=mark)"|"(?:[^"\\\n]|\\.)*"|(?<!\w)\'(?:[^\'\\\n]|\\.)+\''
    r'|#\s*include[^\n]*',
    re.DOTALL)


def term_for(identifier):
    """The term that stands instead of a denied identifier, None for one that is not denied."""
    name = identifier.rstrip("_")
    return next((term for pattern, term in DENIED if pattern.fullmatch(name)), None)


def breaches_of(path, text):
    """Lines of complaint about one file, in the order of its lines."""
    found = []
    code = NO_CODE.sub(lambda match: re.sub(r"[^\n]", " ", match.group()), text)
    for number, (line, whole) in enumerate(zip(code.split("\n"), text.split("\n")), start=1):
        breaches = {}
        for match in IDENTIFIER.finditer(line):
            is_call = line[match.end():].lstrip().startswith("(")
            term = None if is_call and match.group() in VERBS else term_for(match.group())
            if term:
                breaches[match.group()] = f"{path}:{number}: {match.group()}: say {term}"
        found += breaches.values()
        lean = LEANING.search(whole)
        if lean:
            found.append(f'{path}:{number}: "{lean.group(1)}": a doc comment stands alone')
    return found


def check(root):
    breaches = []
    files = 0
    for room in ROOMS:
        for file in sorted((root / room).rglob("*")):
            if file.suffix in SOURCES:
                files += 1
                breaches += breaches_of(file.relative_to(root).as_posix(), file.read_text())
    for breach in breaches:
        print(breach)
    if not files:
        print(f"{root}: no sources found")
    return 1 if breaches or not files else 0


def self_test():
    def complaints(text):
        return breaches_of("core/x.h", text)

    assert complaints("int a;\nconstexpr int kMostEvents = 3;") == ["core/x.h:2: kMostEvents: say kMax..."]
    assert complaints("struct Deed {};") == ["core/x.h:1: Deed: say TraceEvent"]
    assert complaints("lender_ = 1;"), "members count as their names"
    assert complaints("a.tell_all(b);")
    assert complaints('log("x"); Ticket t;'), "code behind a string"
    assert complaints("const int n = 1'000'000; Ticket t;"), "digit separators start no character"
    assert complaints("const Rect place = all[0];")
    assert not complaints("comm.share(8); nodes.place (i);"), "verbs"
    assert not complaints("// a Deed\n/* lender */ int a;"), "comments are prose"
    assert not complaints('say("so many lenders, \\"told\\"");'), "strings are what users read"
    assert not complaints('R"(Ticket)"; #include "scene/point_map.h"')
    assert not complaints("int kMaxEvents, placement, always, MostUsed;"), "only whole identifiers"
    assert complaints("/// The same, but faster.")
    assert complaints("int a;  ///< likewise")
    assert complaints("  /// Likewise for keys.")
    assert not complaints("// The same order as the table's."), "no doc comment"
    assert not complaints("/// Returns the same bits on every rank.")
    return 0


if __name__ == "__main__":
    if "--self-test" in sys.argv:
        sys.exit(self_test())
    sys.exit(check(pathlib.Path(sys.argv[-1])))
