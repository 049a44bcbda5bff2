#pragma once

#include <span>

#include "image/key.h"

namespace hpr {

/// into[i] = max(into[i], from[i]): the nearer surface of two layers, the lower id on equal depths. Both of one length,
/// either the same memory or apart; any alignment of a key. Runs at memory speed, by the widest vectors this machine
/// has, chosen at the first call; every instruction set gives the same bits.
void merge_keys(std::span<Key> into, std::span<const Key> from);

}  // namespace hpr
