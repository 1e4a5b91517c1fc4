//! LaTeX tables, using the package `booktabs`.

use super::arm::{Arm, Sums};
use super::matrix::{Row, matrix};
use super::published::{METHODS, TABLE, total};
use super::source::Source;
use crate::contrast::{Contrast, Scoring};
use crate::stats::Rate;
use crate::task::TaskSet;

/// All files: name and text.
pub(super) fn files(source: &Source) -> Vec<(&'static str, String)> {
    vec![
        ("success-strict.tex", success(source, Scoring::Strict)),
        ("success-paper.tex", success(source, Scoring::Paper)),
        ("methods.tex", methods(source)),
        ("navigation.tex", navigation(source)),
        ("compared.tex", compared(source)),
        ("published.tex", published()),
    ]
}

/// A table, with the first column left-aligned, and its origin in comments above.
fn tabular(source: Option<&Source>, head: &[String], blocks: &[Vec<Vec<String>>]) -> String {
    let comments = source.map_or_else(Vec::new, Source::commands);
    let comments: String = comments.iter().map(|line| format!("% {}\n", line.replace(['\n', '\r'], " "))).collect();
    let row = |cells: &Vec<String>| format!("{} \\\\\n", cells.join(" & "));
    let body: Vec<String> = blocks.iter().map(|block| block.iter().map(row).collect()).collect();
    format!(
        "{comments}\\begin{{tabular}}{{l{}}}\n\\toprule\n{}\\midrule\n{}\\bottomrule\n\\end{{tabular}}\n",
        "r".repeat(head.len().saturating_sub(1)),
        row(&head.to_vec()),
        body.join("\\midrule\n")
    )
}

fn cell(rate: Rate) -> String {
    rate.estimate()
        .map_or_else(|| "--".to_owned(), |e| format!("{}/{} [{:.0}, {:.0}]", rate.hits, rate.of, 100.0 * e.low, 100.0 * e.high))
}

fn success(source: &Source, scoring: Scoring) -> String {
    let arms: Vec<&Arm> = source.arms.iter().collect();
    let head: Vec<String> = std::iter::once("Tasks".to_owned()).chain(arms.iter().map(|arm| escaped(&arm.name()))).collect();
    let (sums, parts): (Vec<Row>, Vec<Row>) = matrix(source, &arms, scoring).into_iter().partition(|row| row.is_sum);
    let block = |rows: Vec<Row>| -> Vec<Vec<String>> {
        rows.into_iter().map(|row| std::iter::once(row.name).chain(row.rates.into_iter().map(cell)).collect()).collect()
    };
    tabular(Some(source), &head, &[block(parts), block(sums)])
}

fn methods(source: &Source) -> String {
    let head = ["Method", "Strict", "Paper", "Collided", "Time, s"].map(str::to_owned);
    let rows = source.arms.iter().map(|arm| {
        let sums = Sums::of(source.of_arm(arm));
        let time =
            sums.quartiles().map_or_else(|| "--".to_owned(), |[low, middle, high]| format!("{middle:.1} [{low:.1}, {high:.1}]"));
        let rates = [sums.strict, sums.paper, sums.collided].map(cell);
        [vec![escaped(&arm.name())], rates.to_vec(), vec![time]].concat()
    });
    tabular(Some(source), &head, &[rows.collect()])
}

fn navigation(source: &Source) -> String {
    let head = ["Method", "SR", "OSR", "NE, m", "SPL", "nDTW", "SDTW", "CR"].map(str::to_owned);
    let shown = |value: Option<f64>, digits: usize| value.map_or_else(|| "--".to_owned(), |value| format!("{value:.digits$}"));
    let rows = source.arms.iter().map(|arm| {
        let means = Sums::of(source.of_arm(arm)).navigation;
        let scores = [means.spl, means.ndtw, means.sdtw].map(|score| shown(score, 2));
        let mut row = vec![escaped(&arm.name()), cell(means.success), cell(means.oracle_success), shown(means.error_m, 1)];
        row.extend(scores);
        row.push(cell(means.collided));
        row
    });
    tabular(Some(source), &head, &[rows.collect()])
}

fn compared(source: &Source) -> String {
    let head = ["Pair", "Scoring", "Points", "Only first : only second", "$p$ (McNemar, Holm)"].map(str::to_owned);
    let row = |scoring: Scoring, contrast: &Contrast| {
        let [first, second] = contrast.pair.each_ref().map(|(method, vlm)| escaped(&format!("{method} {vlm}")));
        let [value, low, high] = contrast.points();
        vec![
            format!("{first} -- {second}"),
            scoring.words().to_owned(),
            format!("${value:+.1}$ [{low:.1}, {high:.1}]"),
            format!("{} : {}", contrast.paired.discordant.first, contrast.paired.discordant.second),
            contrast.format_p().replace('<', "$<$"),
        ]
    };
    let blocks =
        Scoring::ALL.map(|scoring| source.contrasts(scoring).iter().map(|contrast| row(scoring, contrast)).collect::<Vec<_>>());
    let blocks: Vec<Vec<Vec<String>>> = blocks.into_iter().filter(|block| !block.is_empty()).collect();
    tabular(Some(source), &head, &blocks)
}

fn published() -> String {
    let head: Vec<String> = std::iter::once("Published").chain(METHODS).map(str::to_owned).collect();
    let block = |set: TaskSet| {
        let rows = TABLE.iter().filter(|row| row.set == set).map(|row| {
            let name = format!("{}, {}", set.words(), row.category.words());
            std::iter::once(name).chain(row.hits.map(|hits| cell(Rate { hits, of: row.of }))).collect()
        });
        let all =
            std::iter::once(format!("{}, all", set.words())).chain((0..METHODS.len()).map(|method| cell(total(set, method))));
        rows.chain(std::iter::once(all.collect())).collect::<Vec<Vec<String>>>()
    };
    tabular(None, &head, &[block(TaskSet::Simulation), block(TaskSet::RealWorld)])
}

/// Escapes a name for LaTeX; unsupported characters are omitted.
fn escaped(text: &str) -> String {
    text.chars().fold(String::new(), |mut set, letter| {
        match letter {
            '\\' => set += "\\textbackslash{}",
            '^' => set += "\\textasciicircum{}",
            '~' => set += "\\textasciitilde{}",
            '&' | '%' | '$' | '#' | '_' | '{' | '}' => set.extend(['\\', letter]),
            '·' => set += "$\\cdot$",
            other if other.is_control() => set.push(' '),
            other => set.push(other),
        }
        set
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_no_commands() {
        assert_eq!(
            escaped("a_b \\input{x} 5% & #1^~"),
            "a\\_b \\textbackslash{}input\\{x\\} 5\\% \\& \\#1\\textasciicircum{}\\textasciitilde{}"
        );
    }

    #[test]
    fn the_papers_table_has_all_its_rows() {
        let text = published();
        assert_eq!(text.matches("\\\\\n").count(), 13);
        assert!(text.contains("simulation, all & 1/115 [0, 5] & 33/115 [21, 38] & 108/115 [88, 97] \\\\"), "{text}");
    }
}
