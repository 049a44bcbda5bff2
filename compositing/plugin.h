#pragma once

#include <hpr/version.h>

#include <filesystem>
#include <memory>

#include "compositing/compositor.h"

namespace hpr {

/// What a shared object that brings a strategy says of itself.
struct CompositorPlugin {
  const char* built_for;  ///< kBuild of the headers it was compiled with
  std::unique_ptr<Compositor> (*make)();
};

/// Opens a shared object whose source holds HPR_COMPOSITOR_PLUGIN(Strategy), and registers the strategy
/// (register_compositor). It stays open until the process ends. Throws Error: Io when there is no such file, BadInput
/// when it is no plugin, was built for another build of HPR, or brings a name that is taken. Classes and templates have
/// no binary interface that outlasts a version, so a plugin fits only the build whose headers it was compiled with.
void load_compositor_plugin(const std::filesystem::path& path);

}  // namespace hpr

/// The one symbol of a plugin.
extern "C" const hpr::CompositorPlugin* hpr_compositor_plugin();

/// Makes the shared object this stands in bring `Strategy`, a default-constructible Compositor: once, outside of any
/// namespace.
#define HPR_COMPOSITOR_PLUGIN(Strategy)                                                                  \
  extern "C" const hpr::CompositorPlugin* hpr_compositor_plugin() {                                      \
    static const hpr::CompositorPlugin plugin{                                                           \
        hpr::kBuild, []() -> std::unique_ptr<hpr::Compositor> { return std::make_unique<Strategy>(); }}; \
    return &plugin;                                                                                      \
  }
