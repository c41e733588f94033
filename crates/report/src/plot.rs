//! Plots: points and lines over two axes, each linear or logarithmic, as SVG and PNG.

use std::ops::Range;
use std::sync::OnceLock;

use epaint_default_fonts::UBUNTU_LIGHT;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder as _};
use plotters::coord::Shift;
use plotters::coord::ranged1d::{Ranged, ValueFormatter};
use plotters::prelude::*;
use plotters::style::register_font;

/// Width and height of a plot in pixels, its legend apart.
const SIZE: [u32; 2] = [960, 620];
/// Height of a line of the legend, pixels.
const LEGEND_LINE: u32 = 22;
/// Height of the heading, pixels.
const HEADING: u32 = 40;
/// Ticks that an axis has room for.
const MOST_TICKS: usize = 12;
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

impl Series {
    fn has_label(&self) -> bool {
        !self.label.is_empty()
    }

    fn has_line(&self) -> bool {
        matches!(self.mark, Mark::Line | Mark::LinePoints)
    }

    /// Radius and style of its points.
    fn dots(&self) -> Option<(i32, ShapeStyle)> {
        match self.mark {
            Mark::Line => None,
            Mark::Rings => Some((8, self.color().stroke_width(2))),
            Mark::Points | Mark::LinePoints => Some((4, self.color().filled())),
        }
    }

    fn color(&self) -> RGBColor {
        PALETTE[self.color % PALETTE.len()]
    }
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

/// Lower and upper end of an axis around the values, with a margin.
fn range(values: impl Iterator<Item = f64>, log: bool) -> Range<f64> {
    let (low, high) = values
        .filter(|value| value.is_finite() && (!log || *value > 0.0))
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(value), high.max(value))
        });
    let (low, high) = if low > high { (1.0, 10.0) } else { (low, high) };
    if log {
        let margin = (high / low).powf(0.06).max(1.3);
        return low / margin..high * margin;
    }
    // Quantities are not negative here, and 0 belongs to a linear picture of a cost.
    let low = low.min(0.0);
    let high = if high > low { high } else { low + 1.0 };
    low..high + 0.06 * (high - low)
}

/// Round values within the range of a logarithmic axis, [`MOST_TICKS`] or little more. The library's own leave out most of
/// a decade that the range does not hold whole.
fn log_ticks(range: &Range<f64>) -> Vec<f64> {
    let decades = range.start.log10().floor() as i32..=range.end.log10().ceil() as i32;
    let with = |factors: &[f64], stride: usize| -> Vec<f64> {
        let decades = decades.clone().step_by(stride);
        decades
            .flat_map(|decade| factors.iter().map(move |f| f * 10.0_f64.powi(decade)))
            .filter(|value| (range.start..=range.end).contains(value))
            .collect()
    };
    // As many as fit: 1 2 5, else 1 3, else decades, else every other one.
    let found = [&[1.0, 2.0, 5.0][..], &[1.0, 3.0], &[1.0]]
        .map(|factors| with(factors, 1))
        .into_iter()
        .find(|ticks| ticks.len() <= MOST_TICKS)
        .unwrap_or_else(|| with(&[1.0], 2));
    // Within less than a decade there may be none of these.
    if found.len() < 3 {
        even_ticks(range, MOST_TICKS / 2)
    } else {
        found
    }
}

/// Multiples of a round step.
fn even_ticks(range: &Range<f64>, most: usize) -> Vec<f64> {
    let rough = (range.end - range.start) / most as f64;
    let decade = 10.0_f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .map(|factor| factor * decade)
        .into_iter()
        .find(|step| *step >= rough)
        .unwrap_or(rough);
    let first = (range.start / step).ceil() as i64;
    let last = (range.end / step).floor() as i64;
    (first..=last).map(|index| index as f64 * step).collect()
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

/// Draws `chart`, as the bytes of a file for each of `svg` and `png`.
///
/// # Errors
/// What the plotting library says, one line.
pub fn draw(chart: &Chart) -> Result<[(&'static str, Vec<u8>); 2], String> {
    if !has_font() {
        return Err("the embedded font is unusable".to_owned());
    }
    let labels = chart.series.iter().filter(|series| series.has_label());
    let size = (SIZE[0], SIZE[1] + LEGEND_LINE * labels.count() as u32);
    let mut svg = String::new();
    render(chart, SVGBackend::with_string(&mut svg, size))?;
    let mut pixels = vec![0; size.0 as usize * size.1 as usize * 3];
    render(chart, BitMapBackend::with_buffer(&mut pixels, size))?;
    let mut png = Vec::new();
    PngEncoder::new(&mut png)
        .write_image(&pixels, size.0, size.1, ExtendedColorType::Rgb8)
        .map_err(|error| error.to_string())?;
    Ok([("svg", svg.into_bytes()), ("png", png)])
}

fn render(chart: &Chart, backend: impl DrawingBackend) -> Result<(), String> {
    let area = backend.into_drawing_area();
    draw_on(chart, &area).map_err(|error| error.to_string())?;
    area.present().map_err(|error| error.to_string())
}

type Drawn<DB> = Result<(), DrawingAreaErrorKind<<DB as DrawingBackend>::ErrorType>>;

fn draw_on<DB: DrawingBackend>(chart: &Chart, area: &DrawingArea<DB, Shift>) -> Drawn<DB> {
    area.fill(&WHITE)?;
    // The legend stands above the picture, where it hides nothing.
    let labels = || chart.series.iter().filter(|series| series.has_label());
    let (head, body) = area.split_vertically(HEADING + LEGEND_LINE * labels().count() as u32);
    head.draw(&Text::new(chart.title.as_str(), (20, 12), (FONT, 20)))?;
    for (line, series) in labels().enumerate() {
        let y = (HEADING + LEGEND_LINE * line as u32 + LEGEND_LINE / 2) as i32;
        let color = series.color();
        if series.has_line() {
            let ends = [(84, y), (112, y)];
            head.draw(&PathElement::new(ends, color.stroke_width(2)))?;
        }
        if let Some((radius, style)) = series.dots() {
            head.draw(&Circle::new((98, y), radius, style))?;
        }
        head.draw(&Text::new(series.label.as_str(), (124, y - 7), (FONT, 15)))?;
    }
    let points = || chart.series.iter().flat_map(|series| &series.points);
    let x = range(points().map(|point| point.0), chart.log);
    let y = range(points().map(|point| point.1), chart.log);
    let mut builder = ChartBuilder::on(&body);
    builder
        .margin(14)
        .x_label_area_size(48)
        .y_label_area_size(72);
    if chart.log {
        let [x_ticks, y_ticks] = [&x, &y].map(log_ticks);
        let x = x.log_scale().with_key_points(x_ticks);
        let y = y.log_scale().with_key_points(y_ticks);
        draw_series(chart, builder.build_cartesian_2d(x, y)?)
    } else {
        draw_series(chart, builder.build_cartesian_2d(x, y)?)
    }
}

fn draw_series<DB: DrawingBackend, X, Y>(
    chart: &Chart,
    mut context: ChartContext<'_, DB, Cartesian2d<X, Y>>,
) -> Drawn<DB>
where
    X: Ranged<ValueType = f64> + ValueFormatter<f64>,
    Y: Ranged<ValueType = f64> + ValueFormatter<f64>,
{
    context
        .configure_mesh()
        .x_desc(&chart.x_label)
        .y_desc(&chart.y_label)
        .x_label_formatter(&|value| tick_text(*value))
        .y_label_formatter(&|value| tick_text(*value))
        .axis_desc_style((FONT, 16))
        .label_style((FONT, 14))
        .bold_line_style(BLACK.mix(0.15))
        .light_line_style(TRANSPARENT)
        .draw()?;
    let holds = |&(x, y): &(f64, f64)| {
        x.is_finite() && y.is_finite() && (!chart.log || (x > 0.0 && y > 0.0))
    };
    for series in &chart.series {
        let points = || series.points.iter().copied().filter(holds);
        if series.has_line() {
            let style = series.color().stroke_width(2);
            context.draw_series(LineSeries::new(points(), style))?;
        }
        if let Some((radius, style)) = series.dots() {
            context.draw_series(points().map(|point| Circle::new(point, radius, style)))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_hold_their_values() {
        let log = range([1.0, 1000.0, -1.0, f64::NAN].into_iter(), true);
        assert!(log.start < 1.0 && log.start > 0.0 && log.end > 1000.0);
        let linear = range([5.0, 20.0].into_iter(), false);
        assert!(linear.start == 0.0 && linear.end > 20.0);
        // A single value, and none, still make an axis.
        for values in [vec![3.0], vec![]] {
            for log in [true, false] {
                let axis = range(values.iter().copied(), log);
                assert!(axis.end > axis.start);
                assert!(!log || !log_ticks(&axis).is_empty());
            }
        }
    }

    #[test]
    fn ticks_never_crowd() {
        for (low, high) in [(1.0, 1.5), (1.0, 1e3), (1e-9, 1e9), (0.003, 70.0)] {
            let axis = range([low, high].into_iter(), true);
            let ticks = log_ticks(&axis);
            assert!((3..=20).contains(&ticks.len()), "{low} {high}: {ticks:?}");
            assert!(ticks.iter().all(|tick| axis.contains(tick)));
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
        let [(_, svg), (_, png)] = draw(&chart).unwrap();
        let svg = String::from_utf8(svg).unwrap();
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
        for text in [
            "A title",
            "ms per frame",
            "relative MSE",
            "a &lt;series&gt;",
        ] {
            assert!(svg.contains(text), "{text}");
        }
        let picture = image::load_from_memory(&png).unwrap().into_rgb8();
        assert_eq!(picture.dimensions(), (SIZE[0], SIZE[1] + LEGEND_LINE));
        // White paper, and letters on it: the title's rows hold dark pixels.
        let dark = |pixel: &image::Rgb<u8>| pixel.0.iter().all(|channel| *channel < 120);
        let title = picture.rows().take(40).flatten();
        assert!(title.filter(|pixel| dark(pixel)).count() > 50);
        assert!(picture.pixels().filter(|pixel| !dark(pixel)).count() > 500_000);
    }
}
