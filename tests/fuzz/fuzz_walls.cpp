#include "core/error.h"
#include "tests/fuzz/fuzz.h"
#include "walls/config/import/importer.h"
#include "walls/config/wall_file.h"

// Wall files, and those of other programs that are imported.
namespace hpr::fuzz {

std::vector<Bytes> seeds() {
  std::vector<Bytes> all{to_bytes(expand_wall(load_wall("3x2@40x30"))), to_bytes(R"(
hpr_wall = 1
nodes = [ { id = "a", host = "left" }, { id = "b", host = "right" } ]
windows = [ { id = "w0", node = "a" }, { id = "w1", node = "b", rect = [0, 0, 64, 48] } ]
[[surfaces]]
id = "wall"
[surfaces.grid]
columns = 2
rows = 1
tile_pixels = [64, 48]
tile_size_m = [0.64, 0.48]
gap_m = [0.01, -0.01]
rotate = 180
edge_blend_m = { left = 0.1, gamma = 2.2 }
windows = ["w0", "w1"]
curve = { radius_m = 3.0 }
[[viewers]]
id = "v"
position_m = [0, 1.6, 2]
ipd_m = 0.06
)"),
                         to_bytes(R"(<?xml version="1.0" ?><configuration>
<dimensions numTilesWidth="2" numTilesHeight="1" screenWidth="256" screenHeight="160" mullionWidth="9" mullionHeight="11"/>
<process host="a" display=":0.0"><screen x="0" y="0" i="0" j="0"/><screen x="0" y="9" i="1" j="0"/></process>
</configuration>)"),
                         to_bytes(R"(<pvx><Process Type="server"><EyeSeparation Value="0.065"/>
<Option Name="tile-dimensions-x" Value="2"/><Option Name="tile-mullion-x" Value="20"/>
<Machine Name="l" Environment="DISPLAY=l:0.1" Geometry="120x12+1+2" LowerLeft="-1 -1 1" LowerRight="-1 -1 -1" UpperRight="-1 1 -1"/>
</Process></pvx>)"),
                         to_bytes(R"({"screens":[{"screenID":0,"host":"a","topLeft":[0,1,0],"bottomLeft":[0,0,0],
"bottomRight":[1,0,0],"mullionLeft":0.1,"width":64,"height":48}],"global":{"wall":{"size":[1,2]}},
"surfaces":[{"displayWidth":64,"displayHeight":48,"bezelWidth":1,"screenCountX":1,"screenCountY":1}]})")};
  return all;
}

bool run(std::span<const std::byte> input) {
  const std::string text(reinterpret_cast<const char*>(input.data()), input.size());
  bool good = parse_wall(text, "wall.toml").ok();
  for (const WallImporter& importer : all_importers()) {
    try {
      (void)import_wall(text, "wall", importer.name, {});
      good = true;
    } catch (const Error& error) {
      if (error.code() == ExitCode::Internal) throw;  // a fault of the program's
    }
  }
  return good;
}

Bytes repaired(Bytes input) {
  return input;
}

}  // namespace hpr::fuzz
