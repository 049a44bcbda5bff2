#include <filesystem>
#include <string>

#include "core/error.h"
#include "core/file.h"
#include "tests/fuzz/fuzz.h"
#include "walls/config/import/importer.h"
#include "walls/config/wall_file.h"

// Wall files, and those of other programs that are imported.
namespace hpr::fuzz {
namespace {

std::string to_text(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

}  // namespace

std::vector<Bytes> seeds() {
  std::vector<Bytes> all;
  for (const auto& entry : std::filesystem::directory_iterator(HPR_EXAMPLE_WALLS)) {
    if (entry.path().extension() != ".toml") continue;
    const Bytes text = read_file(entry.path(), 1U << 20U);
    if (parse_wall(to_text(text), "wall.toml").ok()) all.push_back(text);  // some need files beside them
  }
  HPR_CHECK(all.size() >= 4);
  const std::vector<Bytes> foreign{
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
  all.insert(all.end(), foreign.begin(), foreign.end());
  return all;
}

bool run(std::span<const std::byte> input) {
  const std::string text = to_text(input);
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
