//! What queries will cost and how long they will take, before they are sent.

use std::io::{BufRead, IsTerminal, Write};

use spf_bench::trial::Record;
use spf_core::prompt::{PromptKind, PromptText};
use spf_vlm::setup::{self, Access};
use spf_vlm::table::{PerMillion, Price};
use spf_vlm::{Tokens, today};

use super::{own, table};
use crate::error::CliError;
use crate::printer::Printer;
use crate::settings::{Settings, environment, variables};

/// Guesses, where nothing was flown before: queries of a flight (those of the paper's suite with the oracle, docs/guide/paper.md),
/// tokens of an image and its schema, of a reply, of thinking, and the latency in seconds.
const QUERIES: f64 = 20.0;
const IMAGE_AND_SCHEMA: f64 = 1500.0;
const REPLY: f64 = 120.0;
const THINKING: f64 = 400.0;
const LATENCY_S: f64 = 2.5;
/// Characters of a prompt per token.
const CHARACTERS: f64 = 4.0;

/// What the queries to one VLM are expected to take.
#[derive(Clone, Debug)]
pub(crate) struct Estimate {
    name: String,
    /// What is asked, in words.
    what: String,
    queries: f64,
    tokens_in: f64,
    tokens_out: f64,
    latency_s: f64,
    price: Option<Price>,
    /// Whether it runs on this machine, where nobody is paid unless a price is given.
    local: bool,
    /// Where the figures come from.
    source: String,
}

impl Estimate {
    /// Of `flights` flights with a VLM, from the flights before that were answered; `None` if it is no model that may cost money.
    pub(crate) fn of_flights(
        settings: &Settings,
        name: &str,
        flights: usize,
        before: &[&Record],
    ) -> Result<Option<Self>, CliError> {
        let Some(guess) = Self::guess(settings, name)? else { return Ok(None) };
        let answered = |record: &&&Record| !record.vlm_details.models.is_empty() && record.tokens_in > 0;
        let before: Vec<&Record> = before.iter().filter(answered).copied().collect();
        let sum = |of: fn(&Record) -> f64| before.iter().map(|record| of(record)).sum::<f64>();
        let queries = sum(|record| f64::from(record.n_vlm_calls));
        let mut estimate = Self {
            what: format!("{flights} flights"),
            queries: flights as f64 * QUERIES,
            source: format!("guessed: {QUERIES} queries a flight"),
            ..guess
        };
        if queries > 0.0 {
            estimate.queries = flights as f64 * queries / before.len() as f64;
            estimate.tokens_in = sum(|record| record.tokens_in as f64) / queries;
            estimate.tokens_out = sum(|record| record.tokens_out as f64) / queries;
            let latencies: Vec<f64> = before.iter().filter_map(|record| Some(record.latency_ms.as_ref()?.p50 / 1e3)).collect();
            estimate.latency_s = spf_bench::stats::mean(&latencies).unwrap_or(LATENCY_S);
            estimate.source = format!("from the {} flights in the folder", before.len());
        }
        Ok(Some(estimate))
    }

    /// The estimate for a number of single questions to a VLM.
    pub(super) fn of_questions(settings: &Settings, name: &str, questions: usize) -> Result<Option<Self>, CliError> {
        let questions_in_words = format!("{questions} questions");
        let guess = Self::guess(settings, name)?;
        Ok(guess.map(|guess| Self { what: questions_in_words, queries: questions as f64, source: "guessed".to_owned(), ..guess }))
    }

    fn guess(settings: &Settings, name: &str) -> Result<Option<Self>, CliError> {
        if name == "oracle" || name.starts_with("oracle:") || name.starts_with("replay:") || own::is_own(name) {
            return Ok(None);
        }
        let choice =
            setup::choose(&table(settings)?, name, &variables()?).map_err(|error| super::refused(settings, name, &error))?;
        let places = environment;
        let local = setup::is_local(&choice, Access { keys: &variables()?, places: &places, send_to: &[] });
        let given: Option<PerMillion> = settings.vlm.price.get()?;
        let price = given.map(Price::from).or_else(|| choice.model.price_on(&today()).cloned());
        let prompt = PromptText::shipped(PromptKind::Point).source().chars().count() as f64;
        Ok(Some(Self {
            name: name.to_owned(),
            what: String::new(),
            queries: 0.0,
            tokens_in: IMAGE_AND_SCHEMA + prompt / CHARACTERS,
            tokens_out: REPLY + if choice.model.thinks { THINKING } else { 0.0 },
            latency_s: LATENCY_S,
            price,
            local,
            source: String::new(),
        }))
    }

    /// US dollars; `None` if no price is known.
    pub(crate) fn cost(&self) -> Option<f64> {
        let count = |tokens: f64| (self.queries * tokens) as u64;
        let tokens = Tokens { input: count(self.tokens_in), output: count(self.tokens_out), ..Tokens::default() };
        self.price.as_ref().map(|price| price.of(&tokens))
    }

    /// Whether it costs nothing, as far as is known.
    fn is_free(&self) -> bool {
        self.cost().map_or(self.local, |cost| cost == 0.0)
    }

    fn words(&self) -> String {
        let cost = self.cost().map_or("price unknown".to_owned(), |cost| format!("about ${cost:.2}"));
        format!(
            "{}: {} = {:.0} queries × {:.0} tokens in and {:.0} out: {cost}, {:.0} minutes of waiting ({})",
            self.name,
            self.what,
            self.queries,
            self.tokens_in,
            self.tokens_out,
            self.queries * self.latency_s / 60.0,
            self.source,
        )
    }
}

/// Prints what the queries will take, and asks on a terminal whether to go on. True without queries to models.
///
/// # Errors
/// Usage, if money may be spent, nobody is there to be asked, and neither `yes` nor a limit of the cost was given.
pub(crate) fn agreed(estimates: &[Estimate], yes: bool, limited: bool, printer: &Printer) -> Result<bool, CliError> {
    let estimates: Vec<&Estimate> = estimates.iter().filter(|estimate| estimate.queries > 0.0).collect();
    estimates.iter().for_each(|estimate| printer.log(&estimate.words()));
    if yes || estimates.iter().all(|estimate| estimate.is_free()) {
        return Ok(true);
    }
    if !std::io::stdin().is_terminal() || !std::io::stderr().is_terminal() {
        return match limited {
            true => Ok(true),
            false => Err(CliError::usage("this may cost money, and without a terminal nobody can be asked")
                .hint("add --max-cost USD, or --yes to go on without a limit")),
        };
    }
    // A question has no end of line.
    let mut out = std::io::stderr().lock();
    drop(write!(out, "Continue? [y/N] ").and_then(|()| out.flush()));
    let mut line = String::new();
    let read = std::io::stdin().lock().read_line(&mut line).is_ok();
    Ok(read && matches!(line.trim().to_lowercase().as_str(), "y" | "yes"))
}
