//! Stretches of residuals within which they may be correlated, for standard errors.

use std::ops::Range;

use super::noise::Noise;
use super::plant::Signal;

/// Least number of values in a block.
pub(super) const BLOCK: usize = 50;
/// Blocks are as long as this number of correlation times of the noise.
const TIMES: f64 = 2.0;

/// Ranges of a run's `count` residuals, each within a channel and at least as long as the noise is correlated; behind those of the values is one of the
/// bench's faults.
pub(super) fn blocks(signal: &Signal, noise: &Noise, count: usize) -> Vec<Range<usize>> {
    let mut all = Vec::new();
    for channel in channels(signal) {
        let times = &signal.times[channel.clone()];
        let length = times.last().zip(times.first()).map_or(0.0, |(last, first)| last - first);
        let rows = if length > 0.0 { TIMES * noise.time_s * channel.len() as f64 / length } else { 0.0 };
        let size = BLOCK.max(rows as usize);
        all.extend(channel.clone().step_by(size).map(|from| from..(from + size).min(channel.end)));
    }
    let faults = signal.values.len()..count;
    all.extend((!faults.is_empty()).then_some(faults));
    all
}

/// Ranges of the values of each channel.
fn channels(signal: &Signal) -> Vec<Range<usize>> {
    let mut all: Vec<Range<usize>> = Vec::new();
    for (at, channel) in signal.channels.iter().enumerate() {
        match all.last_mut().filter(|last| signal.channels[last.start] == *channel) {
            Some(last) => last.end = at + 1,
            None => all.push(at..at + 1),
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_cover_every_residual_once_stay_within_a_channel_and_are_longer_for_slow_noise() {
        let signal = Signal {
            channels: (0..3).flat_map(|channel| [channel; 430]).collect(),
            times: (0..3 * 430).map(|i| 0.01 * f64::from(i % 430)).collect(),
            values: vec![0.0; 3 * 430],
            ..Signal::default()
        };
        for (time_s, longest) in [(0.0, BLOCK), (0.1, BLOCK), (0.7, 140), (1e3, 430)] {
            let noise = Noise { time_s, ..Noise::default() };
            let blocks = blocks(&signal, &noise, 1292);
            assert_eq!((blocks[0].start, blocks.last()), (0, Some(&(1290..1292))));
            assert!(blocks.windows(2).all(|pair| pair[0].end == pair[1].start));
            assert!(blocks.iter().all(|block| block.end > 1290 || block.start / 430 == (block.end - 1) / 430));
            assert_eq!(blocks[0].len(), longest, "{time_s}");
        }
    }
}
