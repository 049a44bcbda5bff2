#include <dlfcn.h>
#include <fmt/format.h>

#include <array>
#include <cstdint>
#include <utility>

#include "core/error.h"
#include "raster/gl.h"
#include "raster/gl_backends.h"

namespace hpr {
namespace {

// The part of <GL/osmesa.h> that is used, so that its package is not needed to build.
struct OsMesaState;
constexpr int kOsMesaFormat = 0x22;
constexpr int kOsMesaProfile = 0x33;
constexpr int kOsMesaCoreProfile = 0x34;
constexpr int kOsMesaMajorVersion = 0x36;
constexpr int kOsMesaMinorVersion = 0x37;
constexpr const char* kLibrary = "libOSMesa.so.8";

struct OsMesa {
  OsMesaState* (*create)(const int* attributes, OsMesaState* shared) = nullptr;
  void (*destroy)(OsMesaState* context) = nullptr;
  GLboolean (*make_current)(OsMesaState* context, void* buffer, GLenum type, GLsizei width, GLsizei height) = nullptr;
  OsMesaState* (*current)() = nullptr;
  GlProc (*proc)(const char* name) = nullptr;
};

template <typename Function>
bool find_symbol(void* library, const char* name, Function& function) {
  function = reinterpret_cast<Function>(dlsym(library, name));
  return function != nullptr;
}

bool find_functions(void* library, OsMesa& osmesa) {
  return find_symbol(library, "OSMesaCreateContextAttribs", osmesa.create) &&
         find_symbol(library, "OSMesaDestroyContext", osmesa.destroy) &&
         find_symbol(library, "OSMesaMakeCurrent", osmesa.make_current) &&
         find_symbol(library, "OSMesaGetCurrentContext", osmesa.current) &&
         find_symbol(library, "OSMesaGetProcAddress", osmesa.proc);
}

class OsMesaContext final : public GlContext {
 public:
  OsMesaContext(const OsMesa& osmesa, OsMesaState* state) : osmesa_(osmesa), state_(state) {}
  OsMesaContext(const OsMesaContext&) = delete;
  OsMesaContext& operator=(const OsMesaContext&) = delete;
  ~OsMesaContext() override {
    OsMesaContext::release();
    osmesa_.destroy(state_);
  }

  void load() {
    make_current();
    gl_ = load_gl_functions([this](const char* name) { return osmesa_.proc(name); });
    info_ = query_gl_info(gl_);
  }

  [[nodiscard]] std::string_view name() const override { return "osmesa"; }
  [[nodiscard]] std::string description() const override {
    return fmt::format("{}, OpenGL {}, OSMesa", info_.renderer, info_.version);
  }
  [[nodiscard]] bool software() const override { return info_.software; }
  [[nodiscard]] const GlFunctions& gl() const override { return gl_; }

  void make_current() override {
    release_egl();
    if (osmesa_.current() == state_) return;
    if (osmesa_.make_current(state_, pixels_.data(), GL_UNSIGNED_BYTE, 1, 1) != GL_TRUE) {
      throw Error(ExitCode::NoDevice, "OSMesa cannot make its context current");
    }
  }
  void release() override {
    if (osmesa_.current() == state_) osmesa_.make_current(nullptr, nullptr, 0, 0, 0);
  }

 private:
  OsMesa osmesa_;
  OsMesaState* state_;
  std::array<std::uint8_t, 4> pixels_{};  ///< OSMesa insists on a window of its own; everything is drawn elsewhere
  GlFunctions gl_;
  GlInfo info_;
};

}  // namespace

std::unique_ptr<GlContext> make_osmesa_context(const GlOptions& options) {
  if (options.device >= 0)
    throw Error(ExitCode::NoDevice, "OSMesa has no devices to choose from", "leave --device away");
  // Never closed: Mesa's threads and exit handlers live in it.
  void* const library = dlopen(kLibrary, RTLD_NOW | RTLD_LOCAL);
  OsMesa osmesa;
  if (library == nullptr || !find_functions(library, osmesa)) {
    const char* const reason = dlerror();
    throw Error(ExitCode::NoDevice, fmt::format("OSMesa: {}", reason == nullptr ? kLibrary : reason),
                "apt-get install libosmesa6");
  }
  release_egl();
  constexpr std::array<int, 9> kAttributes{
      kOsMesaFormat, GL_RGBA, kOsMesaProfile, kOsMesaCoreProfile, kOsMesaMajorVersion, 4, kOsMesaMinorVersion, 5, 0};
  OsMesaState* const state = osmesa.create(kAttributes.data(), nullptr);
  if (state == nullptr) throw Error(ExitCode::NoDevice, "OSMesa: no OpenGL 4.5 core context", "update libosmesa6");
  auto made = std::make_unique<OsMesaContext>(osmesa, state);
  made->load();
  return made;
}

void release_osmesa() {
  void* const library = dlopen(kLibrary, RTLD_NOW | RTLD_LOCAL | RTLD_NOLOAD);
  if (library == nullptr) return;
  OsMesa osmesa;
  if (find_functions(library, osmesa) && osmesa.current() != nullptr) osmesa.make_current(nullptr, nullptr, 0, 0, 0);
  dlclose(library);  // only the reference this function took
}

}  // namespace hpr
