//! Which channels are what, by their names.

use std::fmt;

use super::decode::{File, Place};
use super::{ExrError, ExrOptions};

/// A channel of a file.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ChannelName {
    /// Name of its part; empty for parts without name, and for any part when
    /// asking for a channel.
    pub part: String,
    /// Its name with its layers, as in `depth.Z`.
    pub channel: String,
}

impl ChannelName {
    /// A channel of a part.
    #[must_use]
    pub fn new(part: impl Into<String>, channel: impl Into<String>) -> Self {
        Self {
            part: part.into(),
            channel: channel.into(),
        }
    }
}

impl From<&str> for ChannelName {
    /// `part:channel`, or a channel of any part.
    fn from(name: &str) -> Self {
        match name.split_once(':') {
            Some((part, channel)) => Self::new(part, channel),
            None => Self::new("", name),
        }
    }
}

impl fmt::Display for ChannelName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.part.is_empty() {
            f.write_str(&self.channel)
        } else {
            write!(f, "{}:{}", self.part, self.channel)
        }
    }
}

/// From which frame to which a motion vector points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionDirection {
    /// To where the pixel was in the frame before: velocity is its negative.
    Backward,
    /// To where the pixel will be in the next frame. Velocity is what it is now,
    /// which differs where motion is not steady.
    Forward,
}

/// Channels of motion vectors: pixels, x to the right and y up, as compositing
/// programs have it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Motion {
    /// Horizontal and vertical.
    pub channels: [ChannelName; 2],
    /// Which way they point.
    pub direction: MotionDirection,
}

/// The channels a frame is made of.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FrameChannels {
    /// Red, green, blue and alpha; a channel that is `None` reads 0, alpha 1
    /// where another colour channel is not 0. For grey, name one three times.
    pub colour: Option<[Option<ChannelName>; 4]>,
    /// Depth.
    pub depth: Option<ChannelName>,
    /// Normals.
    pub normal: Option<[ChannelName; 3]>,
    /// Specular reflectance and shininess.
    pub specular: Option<[ChannelName; 4]>,
    /// Motion vectors.
    pub motion: Option<Motion>,
}

/// A channel of a file, its name taken apart.
struct Entry {
    place: Place,
    name: ChannelName,
    view: Option<String>,
    /// Lower-case words of the part and the layers it is in, without views.
    layer: Vec<String>,
    /// What identifies the layer: part and everything before the last dot.
    group: (usize, String),
    /// Lower-case name after the last dot.
    last: String,
}

/// The channels found, and where.
pub(super) struct Chosen {
    pub(super) names: FrameChannels,
    pub(super) colour: [Option<Place>; 4],
    pub(super) depth: Option<Place>,
    pub(super) normal: Option<[Place; 3]>,
    pub(super) specular: Option<[Place; 4]>,
    pub(super) motion: Option<[Place; 2]>,
}

/// Finds the channels of a frame, and the view they are of.
pub(super) fn choose(
    file: &File,
    options: &ExrOptions,
) -> Result<(Chosen, Option<String>), ExrError> {
    let all = Catalogue::new(file);
    if let Some(view) = &options.view
        && !all.views.contains(view)
    {
        return Err(ExrError::NoView {
            view: view.clone(),
            available: all.views,
        });
    }
    let asked = &options.channels;
    let colour = match &asked.colour {
        Some(names) => all.named_optional(names)?,
        None => all
            .colour(options.view.as_deref())
            .ok_or_else(|| ExrError::NoColour {
                available: all.names(),
            })?,
    };
    // The rest is looked for in the view of the colour.
    let view = options
        .view
        .clone()
        .or_else(|| colour.iter().flatten().find_map(|entry| entry.view.clone()));
    let in_view = view.as_deref();
    let depth = match &asked.depth {
        Some(name) => Some(all.named(name)?),
        None => all.depth(in_view),
    };
    let normal = match &asked.normal {
        Some(names) => Some(all.named_all(names)?),
        None => all.vectors(in_view, NORMAL, [["x", "y", "z"], ["r", "g", "b"]]),
    };
    let specular = match &asked.specular {
        Some(names) => Some(all.named_all(names)?),
        None => all.vectors(in_view, &["specularmap"], [["r", "g", "b", "a"]]),
    };
    let (motion, direction) = match &asked.motion {
        Some(motion) => (Some(all.named_all(&motion.channels)?), motion.direction),
        None => all.motion(in_view),
    };
    let names = FrameChannels {
        colour: Some(colour.map(|entry| entry.map(|entry| entry.name.clone()))),
        depth: depth.map(|entry| entry.name.clone()),
        normal: normal.map(|entries| entries.map(|entry| entry.name.clone())),
        specular: specular.map(|entries| entries.map(|entry| entry.name.clone())),
        motion: motion.map(|entries| Motion {
            channels: entries.map(|entry| entry.name.clone()),
            direction,
        }),
    };
    let chosen = Chosen {
        names,
        colour: colour.map(|entry| entry.map(|entry| entry.place)),
        depth: depth.map(|entry| entry.place),
        normal: normal.map(|entries| entries.map(|entry| entry.place)),
        specular: specular.map(|entries| entries.map(|entry| entry.place)),
        motion: motion.map(|entries| entries.map(|entry| entry.place)),
    };
    Ok((chosen, view))
}

/// Layers that hold the finished picture.
const PICTURE: &[&str] = &[
    "rgba", "rgb", "beauty", "combined", "color", "colour", "main", "default", "c",
];
const DEPTH: &[&str] = &["depth", "zdepth", "z"];
const NORMAL: &[&str] = &["n", "nn", "normal", "normals", "nrm", "norm"];
const BACKWARD: &[&str] = &[
    "back",
    "backward",
    "backwards",
    "previous",
    "prev",
    "vector",
];
const FORWARD: &[&str] = &[
    "forward",
    "forwards",
    "next",
    "motion",
    "motionvector",
    "mv",
    "velocity",
];
/// Layers with R, G and B that are no picture.
const OTHER: &[&str] = &[
    "position",
    "p",
    "uv",
    "st",
    "albedo",
    "mask",
    "matte",
    "id",
    "cryptomatte",
    "disparity",
    "disparityl",
    "disparityr",
    "specularmap",
    "roughness",
];

/// All channels of a file.
struct Catalogue {
    entries: Vec<Entry>,
    views: Vec<String>,
}

impl Catalogue {
    fn new(file: &File) -> Self {
        let mut views: Vec<String> = file
            .parts
            .iter()
            .flat_map(|part| part.view.iter().chain(&part.views).cloned())
            .collect();
        views.sort();
        views.dedup();
        let mut entries = Vec::new();
        for (index, part) in file.parts.iter().enumerate() {
            for (channel, name) in part.channels.iter().enumerate() {
                let (prefix, last) = name.rsplit_once('.').unwrap_or(("", name));
                let layer = (part
                    .name
                    .split(is_separator)
                    .chain(prefix.split(is_separator)))
                .filter(|word| !word.is_empty() && !views.iter().any(|view| view == word))
                .map(str::to_lowercase)
                .collect();
                // A part of several views names them among the layers; the
                // first is that of all other channels.
                let named = prefix
                    .split('.')
                    .find(|word| part.views.iter().any(|view| view == word));
                let default = || part.view.clone().or_else(|| part.views.first().cloned());
                entries.push(Entry {
                    place: Place {
                        part: index,
                        channel,
                    },
                    name: ChannelName::new(part.name.clone(), name.clone()),
                    view: named.map(str::to_owned).or_else(default),
                    layer,
                    group: (index, prefix.to_owned()),
                    last: last.to_lowercase(),
                });
            }
        }
        Self { entries, views }
    }

    fn names(&self) -> Vec<String> {
        self.entries
            .iter()
            .map(|entry| entry.name.to_string())
            .collect()
    }

    fn named(&self, name: &ChannelName) -> Result<&Entry, ExrError> {
        self.entries
            .iter()
            .find(|entry| {
                entry.name.channel == name.channel
                    && (name.part.is_empty() || entry.name.part == name.part)
            })
            .ok_or_else(|| ExrError::NoChannel {
                name: name.clone(),
                available: self.names(),
            })
    }

    fn named_all<const N: usize>(&self, names: &[ChannelName; N]) -> Result<[&Entry; N], ExrError> {
        let mut found = [None; N];
        for (entry, name) in found.iter_mut().zip(names) {
            *entry = Some(self.named(name)?);
        }
        all_of(found).ok_or_else(|| ExrError::Malformed("it has no channels".into()))
    }

    fn named_optional(
        &self,
        names: &[Option<ChannelName>; 4],
    ) -> Result<[Option<&Entry>; 4], ExrError> {
        let mut found = [None; 4];
        for (entry, name) in found.iter_mut().zip(names) {
            *entry = name.as_ref().map(|name| self.named(name)).transpose()?;
        }
        Ok(found)
    }

    /// Entries of a view, or of none in particular.
    fn of<'a>(&'a self, view: Option<&'a str>) -> impl Iterator<Item = &'a Entry> {
        self.entries
            .iter()
            .filter(move |entry| match (view, &entry.view) {
                (Some(wanted), Some(view)) => wanted == view,
                _ => true,
            })
    }

    /// The channel of the same layer with another last name.
    fn beside(&self, entry: &Entry, last: &str) -> Option<&Entry> {
        self.entries
            .iter()
            .find(|other| other.group == entry.group && other.last == last)
    }

    fn colour<'a>(&'a self, view: Option<&'a str>) -> Option<[Option<&'a Entry>; 4]> {
        // The layer of the lowest rank, of equals the first in the file.
        self.of(view)
            .filter(|entry| {
                matches!(
                    entry.last.as_str(),
                    "r" | "g" | "b" | "y" | "red" | "green" | "blue"
                )
            })
            .filter_map(|entry| {
                let channel = |short, long| {
                    self.beside(entry, short)
                        .or_else(|| self.beside(entry, long))
                };
                let alpha = channel("a", "alpha");
                let rgb = [
                    channel("r", "red"),
                    channel("g", "green"),
                    channel("b", "blue"),
                ];
                let (colour, grey) = match rgb {
                    [None, None, None] => {
                        // Y beside X is a coordinate, not a brightness.
                        if self.beside(entry, "x").is_some() {
                            return None;
                        }
                        ([Some(entry); 3], true)
                    }
                    rgb => (rgb, false),
                };
                let complete = colour.iter().all(Option::is_some);
                let [r, g, b] = colour;
                let rank = (layer_rank(&entry.layer), !complete, grey);
                Some((rank, [r, g, b, alpha]))
            })
            .min_by_key(|(rank, _)| *rank)
            .map(|(_, colour)| colour)
    }

    fn depth<'a>(&'a self, view: Option<&'a str>) -> Option<&'a Entry> {
        self.of(view)
            .filter_map(|entry| {
                let layer = entry.layer.last().map_or("", String::as_str);
                let rank = match entry.last.as_str() {
                    // Z beside X is a coordinate.
                    "z" if self.beside(entry, "x").is_none()
                        && self.beside(entry, "u").is_none() =>
                    {
                        0
                    }
                    "depth" | "zdepth" | "distance" => 1,
                    "r" | "v" | "y" if DEPTH.contains(&layer) => 2,
                    "zback" => 3,
                    _ => return None,
                };
                let elsewhere = !entry
                    .layer
                    .iter()
                    .all(|word| word_is(word, DEPTH) || word_is(word, PICTURE));
                Some(((rank == 3, elsewhere, rank), entry))
            })
            .min_by_key(|(rank, _)| *rank)
            .map(|(_, entry)| entry)
    }

    /// The channels of a layer with one of the words for its last name.
    fn vectors<'a, const N: usize, const M: usize>(
        &'a self,
        view: Option<&'a str>,
        words: &[&str],
        suffixes: [[&str; N]; M],
    ) -> Option<[&'a Entry; N]> {
        suffixes.iter().find_map(|suffixes| {
            self.of(view)
                .filter(|entry| entry.last == suffixes[0])
                .filter(|entry| entry.layer.last().is_some_and(|word| word_is(word, words)))
                .find_map(|entry| all_of(suffixes.map(|suffix| self.beside(entry, suffix))))
        })
    }

    fn motion<'a>(&'a self, view: Option<&'a str>) -> (Option<[&'a Entry; 2]>, MotionDirection) {
        let suffixes = [["u", "v"], ["x", "y"], ["r", "g"]];
        match self.vectors(view, BACKWARD, suffixes) {
            Some(found) => (Some(found), MotionDirection::Backward),
            None => (
                self.vectors(view, FORWARD, suffixes),
                MotionDirection::Forward,
            ),
        }
    }
}

/// How unlikely a layer is to hold the picture.
fn layer_rank(layer: &[String]) -> u8 {
    let any = |words: &[&str]| layer.iter().any(|word| word_is(word, words));
    let special = [DEPTH, NORMAL, BACKWARD, FORWARD, OTHER]
        .into_iter()
        .any(any);
    match layer {
        _ if special => 3,
        [] => 0,
        _ if any(PICTURE) => 1,
        _ => 2,
    }
}

fn is_separator(c: char) -> bool {
    matches!(c, '.' | '_' | '-' | ' ')
}

/// Whether a word is one of the list, whatever digits follow it.
fn word_is(word: &str, words: &[&str]) -> bool {
    words.contains(&word.trim_end_matches(|c: char| c.is_ascii_digit()))
}

fn all_of<T: Copy, const N: usize>(found: [Option<T>; N]) -> Option<[T; N]> {
    let first = found.first().copied().flatten()?;
    found
        .iter()
        .all(Option::is_some)
        .then(|| found.map(|item| item.unwrap_or(first)))
}
