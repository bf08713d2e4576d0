import static no.ntnu.ihb.fmi4j.Fmi4jVariableUtils.readReal;
import static no.ntnu.ihb.fmi4j.Fmi4jVariableUtils.writeReal;

import java.io.File;
import java.io.PrintWriter;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.List;
import no.ntnu.ihb.fmi4j.importer.fmi2.CoSimulationSlave;
import no.ntnu.ihb.fmi4j.importer.fmi2.Fmu;

/**
 * FMI4j, Co-Simulation: variables by name. No save and restore: its getFMUstate passes the FMU an uninitialized
 * pointer, which the standard takes for a state to be reused.
 */
public class Fly {
    public static void main(String[] arguments) throws Exception {
        List<String> outputs = Files.readAllLines(Path.of("outputs.txt"));
        List<String> rows = Files.readAllLines(Path.of("manoeuvre.csv"));
        String[] names = rows.get(0).split(",");
        try (Fmu fmu = Fmu.from(new File("rov.fmu"));
                CoSimulationSlave rov = fmu.asCoSimulationFmu().newInstance("rov");
                PrintWriter result = new PrintWriter("result.csv")) {
            rov.setupExperiment();
            for (String line : Files.readAllLines(Path.of("parameters.csv")).stream().skip(1).toList()) {
                String[] parameter = line.split(",");
                writeReal(rov, parameter[0], Double.parseDouble(parameter[1]));
            }
            rov.enterInitializationMode();
            rov.exitInitializationMode();
            result.println("time," + String.join(",", outputs));
            print(result, 0.0, rov, outputs);
            for (int n = 1; n + 1 < rows.size(); n++) {
                String[] row = rows.get(n).split(",");
                double start = Double.parseDouble(row[0]);
                double end = Double.parseDouble(rows.get(n + 1).split(",")[0]);
                for (int i = 1; i < names.length - 1; i++) {
                    writeReal(rov, names[i], Double.parseDouble(row[i]));
                }
                if (!rov.doStep(start, end - start)) {
                    throw new IllegalStateException("the FMU answered " + rov.getLastStatus());
                }
                print(result, end, rov, outputs);
            }
            rov.terminate();
        }
    }

    static void print(PrintWriter result, double time, CoSimulationSlave rov, List<String> outputs) {
        result.print(time);
        for (String name : outputs) {
            result.print("," + readReal(rov, name).getValue());
        }
        result.println();
    }
}
