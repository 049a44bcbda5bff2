#pragma once

#include <string>

namespace hpr {

/// From now on a SIGINT, SIGTERM or SIGHUP that ends this process removes the file of a Unix socket first: those that
/// are caught or ignored already keep what they do. Of more than 16 files the others stay.
void remove_when_ended(const std::string& path);

/// Not any more: it is removed already.
void forget_removal(const std::string& path);

}  // namespace hpr
