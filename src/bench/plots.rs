//! Plots: points and lines over two axes, each linear or logarithmic, as SVG and PNG.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use epaint_default_fonts::UBUNTU_LIGHT;
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use plotters::prelude::*;
use plotters::style::register_font;

use super::BenchError;
use crate::images::{Image, write_atomically, write_png};

/// Width and height of a plot in pixels, its legend apart.
const SIZE: [u32; 2] = [960, 620];
/// Height of a line of the legend, pixels.
const LEGEND_LINE: u32 = 22;
/// Height of the heading, pixels.
const HEADING: u32 = 40;
/// Name under which the font is registered; SVG viewers substitute their own sans-serif.
const FONT: &str = "sans-serif";

/// How a series is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    /// Dots.
    Points,
    /// Circles around dots: the front.
    Rings,
    /// A line through the points in their order.
    Line,
    /// Dots joined by a line.
    LinePoints,
}

/// Points of one kind.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Legend; empty: none.
    pub label: String,
    /// x and y. Points that a logarithmic axis cannot hold are left out.
    pub points: Vec<(f64, f64)>,
    /// Drawn as.
    pub mark: Mark,
    /// Index into the palette.
    pub color: usize,
}

/// A plot.
#[derive(Clone, Debug, PartialEq)]
pub struct Chart {
    /// Heading.
    pub title: String,
    /// x axis with unit.
    pub x_label: String,
    /// y axis with unit.
    pub y_label: String,
    /// Both axes are logarithmic.
    pub log: bool,
    /// What is drawn.
    pub series: Vec<Series>,
}

/// Colours that stay apart for the colour blind (Okabe and Ito 2008, "Color Universal Design").
const PALETTE: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
    RGBColor(60, 60, 60),
];

/// One axis, linear or logarithmic; so that charts of both kinds have one type.
#[derive(Clone, Debug, PartialEq)]
struct Axis {
    range: Range<f64>,
    log: bool,
}

impl Axis {
    /// Around the values, with a margin.
    fn around(values: impl Iterator<Item = f64>, log: bool) -> Self {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for value in values.filter(|value| value.is_finite() && (!log || *value > 0.0)) {
            low = low.min(value);
            high = high.max(value);
        }
        if low > high {
            (low, high) = (1.0, 10.0);
        }
        let range = if log {
            let margin = (high / low).powf(0.06).max(1.3);
            low / margin..high * margin
        } else {
            // Quantities are not negative here, and 0 belongs to a linear picture of a cost.
            let low = low.min(0.0);
            let high = if high > low { high } else { low + 1.0 };
            low..high + 0.06 * (high - low)
        };
        Self { range, log }
    }

    fn share(&self, value: f64) -> f64 {
        let Range { start, end } = self.range;
        if self.log {
            (value / start).ln() / (end / start).ln()
        } else {
            (value - start) / (end - start)
        }
    }

    fn ticks(&self, most: usize) -> Vec<f64> {
        let Range { start, end } = self.range;
        if !self.log {
            return even_ticks(&self.range, most);
        }
        let decades = start.log10().floor() as i32..=end.log10().ceil() as i32;
        let with = |factors: &[f64], stride: usize| -> Vec<f64> {
            decades
                .clone()
                .step_by(stride)
                .flat_map(|decade| factors.iter().map(move |f| f * 10.0_f64.powi(decade)))
                .filter(|value| (start..=end).contains(value))
                .collect()
        };
        // As many as fit: 1 2 5, else 1 3, else decades, else every other one.
        let found = [(&[1.0, 2.0, 5.0][..], 1), (&[1.0, 3.0], 1), (&[1.0], 1)]
            .into_iter()
            .map(|(factors, stride)| with(factors, stride))
            .find(|ticks| ticks.len() <= most)
            .unwrap_or_else(|| with(&[1.0], 2));
        // Within less than a decade there may be none of these.
        if found.len() < 3 {
            even_ticks(&self.range, most.min(6))
        } else {
            found
        }
    }
}

/// Multiples of a round step.
fn even_ticks(range: &Range<f64>, most: usize) -> Vec<f64> {
    let Range { start, end } = *range;
    let rough = (end - start) / most.max(2) as f64;
    let decade = 10.0_f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .map(|factor| factor * decade)
        .into_iter()
        .find(|step| *step >= rough)
        .unwrap_or(rough);
    let first = (start / step).ceil() as i64;
    let last = (end / step).floor() as i64;
    (first..=last).map(|index| index as f64 * step).collect()
}

impl Ranged for Axis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let share = self.share(*value).clamp(-1.0, 2.0);
        limit.0 + (share * f64::from(limit.1 - limit.0)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        self.ticks(hint.max_num_points().min(12))
    }

    fn range(&self) -> Range<f64> {
        self.range.clone()
    }
}

impl ValueFormatter<f64> for Axis {
    fn format(value: &f64) -> String {
        tick_text(*value)
    }
}

/// A number as short as it can be read.
#[must_use]
pub fn tick_text(value: f64) -> String {
    let size = value.abs();
    let units = [(1e9, "G"), (1e6, "M"), (1e4, "k")];
    if let Some((_, unit)) = units.iter().find(|(least, _)| size >= *least) {
        let scale = match *unit {
            "G" => 1e9,
            "M" => 1e6,
            _ => 1e3,
        };
        return format!("{}{unit}", plain((value / scale * 100.0).round() / 100.0));
    }
    if size == 0.0 {
        "0".to_owned()
    } else if size < 1e-3 {
        format!("{value:.0e}")
    } else {
        plain(value)
    }
}

/// Up to four decimals, without trailing zeros.
fn plain(value: f64) -> String {
    let text = format!("{value:.4}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn has_font() -> bool {
    static REGISTERED: OnceLock<bool> = OnceLock::new();
    *REGISTERED.get_or_init(|| register_font(FONT, FontStyle::Normal, UBUNTU_LIGHT).is_ok())
}

/// Draws `chart` to `stem`.svg and `stem`.png.
///
/// # Errors
/// [`BenchError::Plot`], [`BenchError::Image`].
pub fn draw(chart: &Chart, stem: &Path) -> Result<[PathBuf; 2], BenchError> {
    let [svg_path, png_path] = ["svg", "png"].map(|extension| stem.with_extension(extension));
    let fail = |path: &PathBuf, reason: String| BenchError::Plot {
        path: path.clone(),
        reason,
    };
    if !has_font() {
        return Err(fail(&svg_path, "the embedded font is unusable".to_owned()));
    }
    let legend = chart
        .series
        .iter()
        .filter(|series| !series.label.is_empty());
    let size = (SIZE[0], SIZE[1] + LEGEND_LINE * legend.count() as u32);
    let mut svg = String::new();
    render(
        chart,
        SVGBackend::with_string(&mut svg, size).into_drawing_area(),
    )
    .map_err(|reason| fail(&svg_path, reason))?;
    write_atomically(&svg_path, |out| {
        std::io::Write::write_all(out, svg.as_bytes())
    })?;

    let mut bytes = vec![0; size.0 as usize * size.1 as usize * 3];
    render(
        chart,
        BitMapBackend::with_buffer(&mut bytes, size).into_drawing_area(),
    )
    .map_err(|reason| fail(&png_path, reason))?;
    let pixels = bytes.as_chunks::<3>().0.to_vec();
    write_png(&png_path, &Image::new(size.0, size.1, pixels)?)?;
    Ok([svg_path, png_path])
}

fn render<DB: DrawingBackend>(
    chart: &Chart,
    area: DrawingArea<DB, plotters::coord::Shift>,
) -> Result<(), String> {
    draw_on(chart, &area).map_err(|error| error.to_string())?;
    area.present().map_err(|error| error.to_string())
}

fn draw_on<DB: DrawingBackend>(
    chart: &Chart,
    area: &DrawingArea<DB, plotters::coord::Shift>,
) -> Result<(), DrawingAreaErrorKind<DB::ErrorType>> {
    area.fill(&WHITE)?;
    let points = || chart.series.iter().flat_map(|series| &series.points);
    let x = Axis::around(points().map(|point| point.0), chart.log);
    let y = Axis::around(points().map(|point| point.1), chart.log);
    let holds = |point: &(f64, f64)| {
        point.0.is_finite()
            && point.1.is_finite()
            && (!chart.log || (point.0 > 0.0 && point.1 > 0.0))
    };
    // The legend stands above the picture, where it hides nothing.
    let labels: Vec<&Series> = chart
        .series
        .iter()
        .filter(|series| !series.label.is_empty())
        .collect();
    let (head, body) = area.split_vertically(HEADING + LEGEND_LINE * labels.len() as u32);
    head.draw(&Text::new(chart.title.as_str(), (20, 12), (FONT, 20)))?;
    for (line, series) in labels.into_iter().enumerate() {
        let y = (HEADING + LEGEND_LINE * line as u32 + LEGEND_LINE / 2) as i32;
        let color = PALETTE[series.color % PALETTE.len()];
        if matches!(series.mark, Mark::Line | Mark::LinePoints) {
            head.draw(&PathElement::new(
                [(84, y), (112, y)],
                color.stroke_width(2),
            ))?;
        }
        match series.mark {
            Mark::Line => {}
            Mark::Rings => head.draw(&Circle::new((98, y), 7, color.stroke_width(2)))?,
            Mark::Points | Mark::LinePoints => {
                head.draw(&Circle::new((98, y), 4, color.filled()))?;
            }
        }
        head.draw(&Text::new(series.label.as_str(), (124, y - 7), (FONT, 15)))?;
    }
    let mut context = ChartBuilder::on(&body)
        .margin(14)
        .x_label_area_size(48)
        .y_label_area_size(72)
        .build_cartesian_2d(x, y)?;
    context
        .configure_mesh()
        .x_desc(&chart.x_label)
        .y_desc(&chart.y_label)
        .axis_desc_style((FONT, 16))
        .label_style((FONT, 14))
        .bold_line_style(BLACK.mix(0.15))
        .light_line_style(TRANSPARENT)
        .draw()?;
    for series in &chart.series {
        let color = PALETTE[series.color % PALETTE.len()];
        let points: Vec<(f64, f64)> = series.points.iter().copied().filter(holds).collect();
        let line = matches!(series.mark, Mark::Line | Mark::LinePoints);
        let filled = matches!(series.mark, Mark::Points | Mark::LinePoints);
        if line {
            context.draw_series(LineSeries::new(
                points.iter().copied(),
                color.stroke_width(2),
            ))?;
        }
        if filled || series.mark == Mark::Rings {
            let (radius, style) = if filled {
                (4, color.filled())
            } else {
                (8, color.stroke_width(2))
            };
            context.draw_series(
                points
                    .iter()
                    .map(|&point| Circle::new(point, radius, style)),
            )?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_hold_their_values_and_map_them_in_order() {
        let log = Axis::around([1.0, 1000.0, -1.0, f64::NAN].into_iter(), true);
        assert!(log.range.start < 1.0 && log.range.start > 0.0 && log.range.end > 1000.0);
        assert!(log.ticks(12).contains(&10.0));
        // Equal factors are equal distances.
        let place = |value: f64| log.map(&value, (0, 100_000));
        assert!(((place(10.0) - place(1.0)) - (place(1000.0) - place(100.0))).abs() <= 1);
        let linear = Axis::around([5.0, 20.0].into_iter(), false);
        assert_eq!(linear.range.start, 0.0);
        assert_eq!(linear.map(&0.0, (600, 0)), 600);
        assert!(linear.ticks(12).contains(&10.0));
        // A single value, and none, still make an axis.
        for values in [vec![3.0], vec![]] {
            for log in [true, false] {
                let axis = Axis::around(values.iter().copied(), log);
                assert!(axis.range.end > axis.range.start);
                assert!(!axis.ticks(10).is_empty(), "{axis:?}");
            }
        }
    }

    #[test]
    fn ticks_never_crowd() {
        for (low, high) in [(1.0, 1.5), (1.0, 1e3), (1e-9, 1e9), (0.003, 70.0)] {
            for log in [true, false] {
                let axis = Axis::around([low, high].into_iter(), log);
                let ticks = axis.ticks(10);
                assert!(
                    ticks.len() <= 20 && !ticks.is_empty(),
                    "{low} {high} {log}: {ticks:?}"
                );
            }
        }
    }

    #[test]
    fn numbers_are_short() {
        for (value, text) in [
            (0.0, "0"),
            (0.5, "0.5"),
            (1000.0, "1000"),
            (20_000.0, "20k"),
            (16_384.0, "16.38k"),
            (2e6, "2M"),
            (0.0001, "1e-4"),
            (12.0, "12"),
        ] {
            assert_eq!(tick_text(value), text);
        }
    }

    #[test]
    fn both_files_hold_ink() {
        let folder = std::env::temp_dir().join(format!("stereolux-plot-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let chart = Chart {
            title: "A title".to_owned(),
            x_label: "ms per frame".to_owned(),
            y_label: "relative MSE".to_owned(),
            log: true,
            series: vec![Series {
                label: "a <series>".to_owned(),
                points: vec![(1.0, 0.1), (10.0, 0.01), (0.0, 5.0)],
                mark: Mark::LinePoints,
                color: 0,
            }],
        };
        let [svg, png] = draw(&chart, &folder.join("plot")).unwrap();
        let svg = std::fs::read_to_string(svg).unwrap();
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
        for text in [
            "A title",
            "ms per frame",
            "relative MSE",
            "a &lt;series&gt;",
        ] {
            assert!(svg.contains(text), "{text}");
        }
        let picture = crate::images::read_image(&png).unwrap();
        assert_eq!(
            [picture.width, picture.height],
            [SIZE[0], SIZE[1] + LEGEND_LINE]
        );
        // White paper, and letters on it: the title's rows hold dark pixels.
        let dark = |pixel: &[f32; 3]| pixel.iter().all(|channel| *channel < 0.2);
        let title = &picture.pixels[..(40 * SIZE[0]) as usize];
        assert!(title.iter().filter(|pixel| dark(pixel)).count() > 50);
        assert!(picture.pixels.iter().filter(|pixel| !dark(pixel)).count() > 500_000);
        std::fs::remove_dir_all(folder).unwrap();
    }
}
