//! What the sanitiser found, on the page.

use std::fmt::Write;

use crate::model::Report;
use crate::sanitise::Finding;
use crate::text::{escape, power};

/// The section with all sites; nothing if the sanitiser did not run.
pub(super) fn sites(body: &mut String, report: &Report) {
    let ran = report
        .cases
        .iter()
        .any(|case| case.results.iter().any(|one| one.sanitised.is_some()));
    if !ran {
        return;
    }
    body.push_str(
        "<h2>Inside of kernels</h2>\n<p class=\"muted\">Every operation in <code>f32</code> beside the same in \
         <code>f64</code>. <em>Birth</em> is a NaN or infinity from finite operands and <em>inaccurate</em> a value \
         stored with an error over 2<sup>-11</sup>: these count against a kernel. Where digits cancel, where a \
         comparison or an integer comes out otherwise in <code>f64</code>, and where a NaN ends without a trace is \
         to be known, and allowed in the kernel with its reason. Maps show the worst case: errors from dark to \
         light, <span class=\"unstable\">decisions that are not stable</span>, \
         <span class=\"born\">births</span>.</p>\n",
    );
    let (open, allowed): (Vec<_>, Vec<_>) = report
        .sites
        .iter()
        .partition(|finding| finding.allowed.is_none());
    table(body, "sites", &open);
    let _ = writeln!(
        body,
        "<details><summary>{} more that kernels allow</summary>",
        allowed.len()
    );
    table(body, "allowed", &allowed);
    body.push_str("</details>\n");
    for (file, line, fault) in &report.unused {
        let _ = writeln!(
            body,
            "<p class=\"muted\">{}:{line} allows {}, which no case has.</p>",
            escape(file),
            escape(fault)
        );
    }
}

fn table(body: &mut String, id: &str, findings: &[&Finding]) {
    if findings.is_empty() {
        body.push_str("<p>None.</p>\n");
        return;
    }
    let _ = write!(
        body,
        "<div class=\"scroll\"><table id=\"{id}\">\n<thead><tr><th>Place</th><th>Fault</th><th>Times</th>\
         <th>Worst</th><th>ulp</th><th>99 %</th><th>Made here</th><th>Bits cancelled</th><th>Map</th></tr></thead>\n<tbody>\n"
    );
    for finding in findings {
        row(body, finding);
    }
    body.push_str("</tbody>\n</table></div>\n");
}

fn row(body: &mut String, finding: &Finding) {
    let exact = finding
        .exact
        .map_or_else(|| "no number".to_owned(), |exact| format!("{exact:e}"));
    let _ = write!(
        body,
        "<tr{}><td><strong>{}</strong> <code>{}</code><br><span class=\"muted\">{}, {}, invocation {:?}: {:e}, in \
         <code>f64</code> {exact}</span>",
        if finding.counts() {
            " class=\"bad\""
        } else {
            ""
        },
        escape(&finding.place()),
        escape(&finding.operation),
        escape(&finding.worst_case),
        escape(&finding.worst_step),
        finding.worst_invocation,
        finding.value,
    );
    if let Some(reason) = &finding.allowed {
        let _ = write!(body, "<br>allowed: {}", escape(reason));
    }
    let map = finding.heat.as_deref().map_or_else(String::new, |file| {
        format!(
            "<img src=\"{0}\" alt=\"where\" loading=\"lazy\">",
            escape(file)
        )
    });
    let severity = if matches!(finding.fault.as_str(), "birth" | "death") {
        String::new()
    } else {
        power(finding.severity)
    };
    let _ = writeln!(
        body,
        "</td><td>{}</td><td class=\"number\" title=\"in {} cases\">{} of {}</td><td class=\"number\">{severity}</td>\
         <td class=\"number\">{}</td><td class=\"number\">{}</td><td class=\"number\">{:.2}</td>\
         <td class=\"number\">{}</td><td>{map}</td></tr>",
        escape(&finding.fault),
        finding.cases,
        finding.times,
        finding.executions,
        units(finding.max_ulps),
        units(finding.p99_ulps),
        finding.introduced_ulps,
        finding.cancelled_bits,
    );
}

/// Units in the last place; from where not even the exponent is right, that.
fn units(ulps: f64) -> String {
    if ulps >= 16_777_216.0 {
        "all".to_owned()
    } else if ulps >= 1000.0 {
        format!("{ulps:.0}")
    } else {
        format!("{ulps:.2}")
    }
}
