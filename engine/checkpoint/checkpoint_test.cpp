#include "engine/checkpoint/checkpoint.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "core/error.h"
#include "engine/film.h"
#include "engine/samples.h"

namespace hpr {
namespace {

const RunIdentity kIdentity{{"scene", "0123"}, {"seed", "1"}, {"filter", "box"}};
const FilmContent kContent{{Aov::Id, Aov::Direct, Aov::Rank, Aov::Cost, Aov::Coverage}, true, 8};
const FrameLayout kLayout({{100, 70}, {10, 10}});

/// A film with something in every layer, and an empty tile.
Film some_film() {
  Film film(kLayout, kContent);
  double value = 0.1;
  film.each_layer([&](auto& layer) {
    for (std::size_t tile = 0; tile < layer.tiles(); ++tile) {
      if (tile == 2) continue;
      layer.set_active(tile);
      for (auto& pixel : layer.tile(tile)) {
        value *= 1.0001;
        const std::span<std::byte> to = std::as_writable_bytes(std::span(&pixel, 1));
        std::ranges::copy(std::as_bytes(std::span(&value, 1)).first(std::min(to.size(), sizeof value)), to.begin());
      }
    }
  });
  for (PixelSamples& pixel : film.pixel_samples().tile(0)) pixel.wanted = 16;
  film.set_counters({17, {8.0, 9.0}});
  return film;
}

std::vector<std::byte> some_checkpoint() {
  Film film = some_film();
  return encode_checkpoint(kIdentity, film, {15, 3.5, 0.25, 64});
}

/// What a checkpoint is refused with; empty when it is taken.
std::string refusal(std::span<const std::byte> bytes, const RunIdentity& identity = kIdentity) {
  Film film(kLayout, kContent);
  try {
    (void)decode_checkpoint(bytes, "a.checkpoint", identity, film);
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::BadInput);
    return error.what();
  }
  return {};
}

TEST(Checkpoint, GivesBackEveryBit) {
  const std::vector<std::byte> bytes = some_checkpoint();
  Film film(kLayout, kContent);
  const SampleProgress progress = decode_checkpoint(bytes, "a.checkpoint", kIdentity, film);
  EXPECT_EQ(progress.samples, 15U);
  EXPECT_EQ(progress.budget, 64U);
  EXPECT_EQ(film.samples(), 17U);
  EXPECT_EQ(progress.seconds, 3.5);
  EXPECT_EQ(progress.relmse, 0.25);
  EXPECT_EQ(film.counters().weights[1], 9.0);
  EXPECT_EQ(encode_checkpoint(kIdentity, film, progress), bytes);
}

TEST(Checkpoint, EveryDamagedOrShortenedFileIsRefused) {
  const std::vector<std::byte> bytes = some_checkpoint();
  for (std::size_t at = 0; at < bytes.size(); at += at < 200 ? 1 : 9973) {
    std::vector<std::byte> damaged = bytes;
    damaged[at] ^= std::byte{0x10};
    EXPECT_NE(refusal(damaged), "") << at;
    EXPECT_NE(refusal(std::span(bytes).first(at)), "") << at;
  }
  EXPECT_NE(refusal(std::span(bytes).first(bytes.size() - 1)), "");
}

TEST(Checkpoint, TheErrorNamesWhatDiffers) {
  const std::vector<std::byte> bytes = some_checkpoint();
  EXPECT_NE(refusal(bytes, {{"scene", "0123"}, {"seed", "2"}, {"filter", "box"}}).find("seed is 1, not 2"),
            std::string::npos);
  EXPECT_NE(refusal(bytes, {{"scene", "0123"}, {"seed", "1"}}).find("filter"), std::string::npos);
  EXPECT_NE(refusal(bytes, {{"scene", "0123"}, {"seed", "1"}, {"filter", "box"}, {"light", "x"}}).find("light"),
            std::string::npos);
}

TEST(Checkpoint, OtherFormatsAreNamed) {
  std::vector<std::byte> bytes = some_checkpoint();
  bytes[8] = std::byte{1};
  EXPECT_NE(refusal(bytes).find("format 1"), std::string::npos);
  EXPECT_NE(refusal(std::as_bytes(std::span("no checkpoint at all"))).find("not a checkpoint"), std::string::npos);
}

TEST(Checkpoint, WhatNoRunCanHaveComeToIsRefused) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto refusal_of = [](const auto& change) {
    Film film = some_film();
    SampleProgress progress{15, 3.5, 0.25, 64};
    change(film, progress);
    return refusal(encode_checkpoint(kIdentity, film, progress));
  };
  EXPECT_EQ(refusal_of([](Film&, SampleProgress&) {}), "");
  // A step for every power of two up to what a pixel wants: past 2^31 there is no end of them.
  EXPECT_NE(refusal_of([](Film& film, SampleProgress&) { film.pixel_samples().tile(0)[5].wanted = 0xC0000000U; }), "");
  EXPECT_NE(refusal_of([&](Film& film, SampleProgress&) { film.pixel_samples().tile(0)[5].weights[1] = nan; }), "");
  EXPECT_NE(refusal_of([&](Film& film, SampleProgress&) { film.set_counters({17, {1.0, nan}}); }), "");
  EXPECT_NE(refusal_of([](Film&, SampleProgress& progress) { progress.budget = kContent.pilot - 1; }), "");
  EXPECT_NE(refusal_of([&](Film&, SampleProgress& progress) { progress.seconds = nan; }), "");
  EXPECT_NE(refusal_of([&](Film& film, SampleProgress&) {
              film.each_layer([&](auto& layer) {
                using Pixel = std::remove_cvref_t<decltype(layer.tile(0)[0])>;
                if constexpr (std::is_same_v<Pixel, ColorSum>) layer.tile(0)[9].g = nan;
              });
            }),
            "");
}

TEST(Checkpoint, ARightSumOverWrongContentIsRefusedToo) {
  // The layers of a film of another shape under the same identity: a program that forgot to name a difference.
  Film other(FrameLayout({{300, 300}}), kContent);
  other.each_layer([](auto& layer) {
    for (std::size_t tile = 0; tile < layer.tiles(); ++tile) layer.set_active(tile);
  });
  EXPECT_NE(refusal(encode_checkpoint(kIdentity, other, {})).find("damaged"), std::string::npos);
}

TEST(Checkpoint, SaysWhetherADeviceMadeKeysOrLight) {
  EXPECT_FALSE(had_device({{"device", "none"}}));
  EXPECT_FALSE(had_device({{"seed", "1"}}));
  EXPECT_TRUE(had_device({{"seed", "1"}, {"device", "card 1, driver 2"}}));
}

}  // namespace
}  // namespace hpr
