#include "walls/displays/x_server.h"

#include <X11/Xlib.h>
#include <unistd.h>

#include "core/error.h"
#include "core/log.h"

namespace hpr {
namespace {

int end_process(::Display* display) {
  log::error("the X server '{}' is gone", XDisplayString(display));
  // What exit() would run may wait for the thread that is in here.
  ::_exit(static_cast<int>(ExitCode::Lost));
}

}  // namespace

void end_with_x_server() {
  XSetIOErrorHandler(end_process);
}

}  // namespace hpr
