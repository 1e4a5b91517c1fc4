//! Pre- and postprocessing: from a frame to the input, and from the output to boxes.

use divan::{Bencher, black_box};
use spf_detect::decode::{Candidate, Layout, suppress};
use spf_detect::letterbox::Letterbox;
use spf_media::Rgb;

const INPUT: (usize, usize) = (640, 640);
const CELLS: usize = 8400;
const ROWS: usize = 84;

fn main() {
    divan::main();
}

/// An output in which every twentieth cell has a confident detection, as around a few objects.
fn output() -> Vec<f32> {
    let value = |row: usize, cell: usize| match row {
        0 => (cell * 37 % 640) as f32,
        1 => (cell * 91 % 640) as f32,
        2 | 3 => 40.0,
        _ if cell.is_multiple_of(20) && row == 4 + cell / 20 % 80 => 0.3 + (cell % 7) as f32 / 20.0,
        _ => 0.01,
    };
    (0..ROWS).flat_map(|row| (0..CELLS).map(move |cell| value(row, cell))).collect()
}

fn transposed(values: &[f32]) -> Vec<f32> {
    (0..CELLS).flat_map(|cell| (0..ROWS).map(move |row| values[row * CELLS + cell])).collect()
}

fn candidates() -> Vec<Candidate> {
    let layout = Layout::of(&[1, ROWS, CELLS], INPUT, Some(80), false, None).expect("the default layout");
    layout.decode(&[1, ROWS, CELLS], &output()).expect("an output of that layout")
}

#[divan::bench]
fn letterbox_960x720(bencher: Bencher<'_, '_>) {
    let image = Rgb::filled(960, 720, [80, 120, 160]);
    let letterbox = Letterbox::new((960, 720), INPUT);
    let mut values = Vec::new();
    bencher.bench_local(|| letterbox.fill(black_box(&image), &mut values));
}

#[divan::bench]
fn decode_rows(bencher: Bencher<'_, '_>) {
    let (shape, values) = ([1, ROWS, CELLS], output());
    let layout = Layout::of(&shape, INPUT, Some(80), false, None).expect("the default layout");
    bencher.bench(|| layout.decode(&shape, black_box(&values)));
}

#[divan::bench]
fn decode_cells(bencher: Bencher<'_, '_>) {
    let (shape, values) = ([1, CELLS, ROWS], transposed(&output()));
    let layout = Layout::of(&shape, INPUT, Some(80), false, None).expect("the transposed layout");
    bencher.bench(|| layout.decode(&shape, black_box(&values)));
}

#[divan::bench]
fn suppress_420(bencher: Bencher<'_, '_>) {
    let all = candidates();
    bencher.with_inputs(|| all.clone()).bench_values(|all| suppress(all, false));
}
