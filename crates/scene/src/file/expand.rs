//! Expands a file to one entry per object: merges templates, unrolls places and rows, validates everything.

use std::collections::BTreeSet;
use std::ops::Range;

use toml::Spanned;

use super::model::{self, Models};
use super::motion::motion;
use super::raw::{RawObject, RawScene};
use super::source::{Source, first_line};
use crate::actors::Motion;
use crate::error::{SceneError, hint_from, nearest};
use crate::limits::{FARTHEST, LONGEST_TAG, MAX_OBJECTS};
use crate::mesh::{Generator, KINDS};
use crate::world::Tags;

/// One object of the scene before its mesh is built.
#[derive(Debug)]
pub(super) struct Placed {
    pub(super) key: String,
    pub(super) tags: Tags,
    /// Key of the object that an opening leads through.
    pub(super) opening_of: Option<(String, Range<usize>)>,
    /// Key of the object that a look-alike seems to be.
    pub(super) looks_like: Option<(String, Range<usize>)>,
    /// Name of its main part, if the file says.
    pub(super) main_part: Option<(String, Range<usize>)>,
    /// Index into the generators.
    pub(super) mesh: usize,
    /// Kind of that generator.
    pub(super) mesh_kind: &'static str,
    /// Index of its model, if it is one.
    pub(super) model: Option<usize>,
    /// Slot and material, with their position in the text.
    pub(super) materials: Vec<(String, String, Range<usize>)>,
    /// East, north, up, metres.
    pub(super) position: [f64; 3],
    /// Clockwise from north, degrees.
    pub(super) heading_deg: f64,
    pub(super) scale: f64,
    /// Its motion, if it moves; `position` and `heading_deg` are then those of its path.
    pub(super) motion: Option<Motion>,
    /// The key that suits it better in a variant.
    pub(super) new_key: Option<String>,
    pub(super) span: Range<usize>,
}

/// The objects, and the generators of their meshes.
#[derive(Debug, Default)]
pub(super) struct Expanded {
    pub(super) placed: Vec<Placed>,
    pub(super) meshes: Vec<Box<dyn Generator>>,
    pub(super) models: Models,
    keys: BTreeSet<String>,
}

impl Expanded {
    /// Whether an object has that id.
    pub(super) fn has(&self, key: &str) -> bool {
        self.keys.contains(key)
    }

    /// Removes the last object, which was not part of a row.
    pub(super) fn pop(&mut self) {
        self.meshes.pop();
        if let Some(last) = self.placed.pop() {
            self.keys.remove(&last.key);
        }
    }
}

/// Unrolls all objects of a file.
pub(super) fn expand(raw: &RawScene, source: &Source<'_>) -> Result<Expanded, SceneError> {
    let mut out = Expanded::default();
    for object in &raw.objects {
        unroll(raw, object, &mut out, source)?;
    }
    Ok(out)
}

/// Unrolls one entry: a single object, a row, or one object at each of some places.
pub(super) fn unroll(
    raw: &RawScene,
    object: &Spanned<RawObject>,
    out: &mut Expanded,
    source: &Source<'_>,
) -> Result<(), SceneError> {
    let span = object.span();
    let merged = merge(raw, object.get_ref(), source)?;
    let key = merged.id.clone().unwrap_or_default();
    if key.is_empty() || !key.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_') {
        let hint = "use lower-case letters, digits and `_`, for example `id = \"red_crane\"`".to_owned();
        return Err(source.error(&span, "missing or invalid `id`", Some(hint)));
    }
    let tags = tags(&merged, &span, source)?;
    let materials: Vec<_> =
        merged.materials.iter().map(|(slot, name)| (slot.clone(), name.get_ref().clone(), name.span())).collect();
    let (mesh_kind, mesh, model) = generator(&merged, &mut out.models, &span, source)?;
    check_opening(&merged, mesh.as_ref(), &span, source)?;
    let motion = motion(&merged, source)?;
    let places = match &motion {
        Some(_) if mesh.is_opening() => return Err(source.error(&span, "an opening cannot move", None)),
        Some(_) => vec![([0.0; 3], 0.0)],
        None => places(&merged, &span, source)?,
    };
    out.meshes.push(mesh);
    let single = merged.places.is_none() && merged.repeat.is_none();
    for (i, (position, heading_deg)) in places.into_iter().enumerate() {
        let key = if single { key.clone() } else { format!("{key}_{}", i + 1) };
        if !out.keys.insert(key.clone()) {
            let hint = "each `id` must be unique; `repeat` and `places` append `_1`, `_2`, …".to_owned();
            return Err(source.error(&span, format!("duplicate id `{key}`"), Some(hint)));
        }
        if out.placed.len() >= MAX_OBJECTS {
            return Err(source.error(&span, format!("a scene may have at most {MAX_OBJECTS} objects"), None));
        }
        out.placed.push(Placed {
            key,
            tags: tags.clone(),
            opening_of: merged.opening_of.as_ref().map(|o| (o.get_ref().clone(), o.span())),
            looks_like: merged.looks_like.as_ref().map(|o| (o.get_ref().clone(), o.span())),
            main_part: merged.main_part.as_ref().map(|o| (o.get_ref().clone(), o.span())),
            mesh: out.meshes.len() - 1,
            mesh_kind,
            model,
            materials: materials.clone(),
            position,
            heading_deg,
            scale: scale(&merged, source)?,
            motion: motion.clone(),
            new_key: None,
            span: span.clone(),
        });
    }
    Ok(())
}

/// Merges an object with its template: the object's values win, `materials` are merged.
fn merge(raw: &RawScene, object: &RawObject, source: &Source<'_>) -> Result<RawObject, SceneError> {
    let Some(like) = &object.like else { return Ok(object.clone()) };
    let Some(template) = raw.templates.get(like.get_ref()) else {
        let near = nearest(like.get_ref(), raw.templates.keys().map(String::as_str));
        let hint = near.map(|n| format!("did you mean `{n}`?"));
        return Err(source.error(&like.span(), format!("unknown template `{}`", like.get_ref()), hint));
    };
    let base = template.get_ref().clone();
    if base.like.is_some() || base.id.is_some() || base.places.is_some() || base.repeat.is_some() {
        let hint = "set these keys on the objects".to_owned();
        return Err(source.error(&template.span(), "a template must not have `id`, `like`, `places` or `repeat`", Some(hint)));
    }
    let mut materials = base.materials;
    materials.extend(object.materials.clone());
    let object = object.clone();
    Ok(RawObject {
        id: object.id,
        like: None,
        mesh: object.mesh.or(base.mesh),
        materials,
        position: object.position.or(base.position),
        heading_deg: object.heading_deg.or(base.heading_deg),
        scale: object.scale.or(base.scale),
        places: object.places,
        repeat: object.repeat,
        walk: object.walk.or(base.walk),
        drive: object.drive.or(base.drive),
        opening_of: object.opening_of.or(base.opening_of),
        looks_like: object.looks_like.or(base.looks_like),
        main_part: object.main_part.or(base.main_part),
        names: object.names.or(base.names),
        synonyms: object.synonyms.or(base.synonyms),
        qualities: object.qualities.or(base.qualities),
        colour: object.colour.or(base.colour),
        kind: object.kind.or(base.kind),
        uses: object.uses.or(base.uses),
        group: object.group.or(base.group),
        number: object.number.or(base.number),
    })
}

fn tags(object: &RawObject, span: &Range<usize>, source: &Source<'_>) -> Result<Tags, SceneError> {
    let missing = |key: &str, example: &str| source.error(span, format!("missing `{key}`"), Some(example.to_owned()));
    let names = object.names.clone().filter(|n| !n.is_empty());
    let tags = Tags {
        names: names.ok_or_else(|| {
            missing(
                "names",
                "for example `names = [\"tower crane\", \"crane\"]`, the most specific \
            first",
            )
        })?,
        synonyms: object.synonyms.clone().unwrap_or_default(),
        qualities: object.qualities.clone().unwrap_or_default(),
        colour: object.colour.clone(),
        kind: object.kind.clone().ok_or_else(|| missing("kind", "for example `kind = \"building\"`"))?,
        uses: object.uses.clone().unwrap_or_default(),
        group: object.group.clone(),
        number: object.number,
        opening_of: None,
        looks_like: None,
    };
    let lists = [&tags.names, &tags.synonyms, &tags.qualities, &tags.uses].into_iter().flatten();
    let mut words = lists.chain(tags.colour.as_ref()).chain(tags.group.as_ref()).chain([&tags.kind]);
    let unusable = |w: &&String| w.trim().is_empty() || w.chars().count() > LONGEST_TAG || w.chars().any(char::is_uppercase);
    if let Some(word) = words.find(unusable) {
        let hint = format!("tags must be 1 to {LONGEST_TAG} lower-case characters");
        return Err(source.error(span, format!("invalid tag `{word}`"), Some(hint)));
    }
    drop(words);
    Ok(tags)
}

/// The kind of an object's mesh, its generator, and its model.
type Drawing = (&'static str, Box<dyn Generator>, Option<usize>);

/// The generator of an object's mesh.
fn generator(object: &RawObject, models: &mut Models, span: &Range<usize>, source: &Source<'_>) -> Result<Drawing, SceneError> {
    let Some(mesh) = &object.mesh else {
        let hint = "for example `mesh = { kind = \"tree\", style = \"conifer\", height = 9.0 }`".to_owned();
        return Err(source.error(span, "missing `mesh`", Some(hint)));
    };
    let at = mesh.span();
    let mut table = mesh.get_ref().clone();
    let Some(toml::Value::String(kind)) = table.remove("kind") else {
        return Err(source.error(
            &at,
            "missing `kind` of the mesh",
            Some("for example `mesh = { kind = \"tree\", … }`".to_owned()),
        ));
    };
    if kind == model::KIND {
        let number = models.get(object, table, &at, source)?;
        return Ok((model::KIND, models.generator(number), Some(number)));
    }
    let Some(&(kind, read)) = KINDS.iter().find(|(name, _)| *name == kind) else {
        let hint = match nearest(&kind, KINDS.iter().map(|(name, _)| *name)) {
            Some(near) => format!("did you mean `{near}`?"),
            None => format!("kinds are `{}`", KINDS.iter().map(|(name, _)| *name).collect::<Vec<_>>().join("`, `")),
        };
        return Err(source.error(&at, format!("unknown mesh kind `{kind}`"), Some(hint)));
    };
    let generator = read(table).map_err(|e| {
        let message = first_line(e.message());
        let hint = hint_from(&message);
        source.error(&at, format!("mesh `{kind}`: {message}"), hint)
    })?;
    Ok((kind, generator, None))
}

fn check_opening(object: &RawObject, mesh: &dyn Generator, span: &Range<usize>, source: &Source<'_>) -> Result<(), SceneError> {
    match (&object.opening_of, mesh.is_opening()) {
        (Some(of), false) => {
            let hint = "use `mesh = { kind = \"opening\", shape = \"rectangle\", width = …, height = … }`".to_owned();
            Err(source.error(&of.span(), "`opening_of` is only valid on an opening", Some(hint)))
        }
        (None, true) => {
            let hint = "set `opening_of = \"ID\"`, the object it belongs to".to_owned();
            Err(source.error(span, "an opening needs `opening_of`", Some(hint)))
        }
        _ => Ok(()),
    }
}

fn scale(object: &RawObject, source: &Source<'_>) -> Result<f64, SceneError> {
    match &object.scale {
        Some(s) if !(0.01..=100.0).contains(s.get_ref()) => {
            Err(source.error(&s.span(), format!("`scale` must be from 0.01 to 100, not `{}`", s.get_ref()), None))
        }
        s => Ok(s.as_ref().map_or(1.0, |s| *s.get_ref())),
    }
}

type Place = ([f64; 3], f64);

/// Positions and headings of all instances of an object.
fn places(object: &RawObject, span: &Range<usize>, source: &Source<'_>) -> Result<Vec<Place>, SceneError> {
    let heading = object.heading_deg.as_ref().map_or(0.0, |h| *h.get_ref());
    let checked = |position: [f64; 3], heading: f64, at: &Range<usize>| {
        let fits = position.iter().all(|v| v.abs() <= FARTHEST) && heading.abs() <= 360.0;
        let message = format!("a place must be within {FARTHEST} m of the origin, and its heading from -360 to 360 degrees");
        if fits { Ok((position, heading)) } else { Err(source.error(at, message, None)) }
    };
    if let Some(places) = &object.places {
        if object.position.is_some() || object.repeat.is_some() {
            return Err(source.error(&places.span(), "`places` cannot be combined with `position` or `repeat`", None));
        }
        let at = places.span();
        let place = |p: &Vec<f64>| match p[..] {
            [e, n] => checked([e, n, 0.0], heading, &at),
            [e, n, h] => checked([e, n, 0.0], h, &at),
            [e, n, u, h] => checked([e, n, u], h, &at),
            _ => {
                let hint = "use `[east, north]`, `[east, north, heading_deg]` or `[east, north, up, heading_deg]`".to_owned();
                Err(source.error(&at, "a place must have two to four numbers", Some(hint)))
            }
        };
        return places.get_ref().iter().map(place).collect();
    }
    let Some(position) = &object.position else {
        let hint = "use `position = [east, north]` in metres, or `places = [[east, north], …]`".to_owned();
        return Err(source.error(span, "missing `position`", Some(hint)));
    };
    let at = position.span();
    let first = match position.get_ref()[..] {
        [e, n] => [e, n, 0.0],
        [e, n, u] => [e, n, u],
        _ => {
            let hint = "use `[east, north]` or `[east, north, up]`, in metres".to_owned();
            return Err(source.error(&at, "a position must have two or three numbers", Some(hint)));
        }
    };
    let (count, step) = object.repeat.as_ref().map_or((1, [0.0; 2]), |r| (r.get_ref().count, r.get_ref().step));
    if !(1..=1000).contains(&count) {
        return Err(source.error(&at, format!("`count` must be from 1 to 1000, not `{count}`"), None));
    }
    (0..count)
        .map(|i| {
            let i = f64::from(i);
            checked([first[0] + i * step[0], first[1] + i * step[1], first[2]], heading, &at)
        })
        .collect()
}
