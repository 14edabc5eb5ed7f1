// Loops that newer processors do faster by instructions of their own.
#pragma once

/// Before a loop that processors with AVX2 and fused multiply-add do faster: compiled for these as well, and the loader takes what is right. For
/// functions of their own only, as they are no longer put in line. UNFUSED: without fused products, where what cancels is to cancel to the bit.
#if defined(__x86_64__) && defined(__linux__) && defined(__GNUC__) && !defined(__clang__) && __GNUC__ >= 12 && !defined(__SANITIZE_ADDRESS__)
#define POLYSLIP_BY_PROCESSOR [[gnu::target_clones("default", "arch=x86-64-v3")]]
#define POLYSLIP_BY_PROCESSOR_UNFUSED [[gnu::target_clones("default", "avx2")]]
#else
#define POLYSLIP_BY_PROCESSOR
#define POLYSLIP_BY_PROCESSOR_UNFUSED
#endif
