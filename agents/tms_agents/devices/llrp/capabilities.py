"""What the emulated reader says it can do."""

from __future__ import annotations

from tms_agents.devices.llrp.codec import Parameter

ANTENNAS = 4

CAPABILITIES = (
    Parameter(
        "GeneralDeviceCapabilities",
        {
            "MaxNumberOfAntennaSupported": ANTENNAS,
            "Flags": 0x4000,  # has a UTC clock
            "DeviceManufacturerName": 0,
            "ModelName": 0,
            "ReaderFirmwareVersion": "emulator",
        },
        (Parameter("GPIOCapabilities", {"NumGPIs": 0, "NumGPOs": 0}),),
    ),
    Parameter(
        "LLRPCapabilities",
        {
            "Flags": 0,
            "MaxNumPriorityLevelsSupported": 1,
            "ClientRequestOpSpecTimeout": 0,
            "MaxNumROSpecs": 1,
            "MaxNumSpecsPerROSpec": 16,
            "MaxNumInventoryParameterSpecsPerAISpec": 1,
            "MaxNumAccessSpecs": 1,
            "MaxNumOpSpecsPerAccessSpec": 1,
        },
    ),
    Parameter(
        "RegulatoryCapabilities",
        {"CountryCode": 392, "CommunicationsStandard": 0},
        (
            Parameter(
                "UHFBandCapabilities",
                {},
                (
                    Parameter("TransmitPowerLevelTableEntry", {"Index": 1, "TransmitPowerValue": 3000}),
                    Parameter(
                        "FrequencyInformation",
                        {"Hopping": 0},
                        (Parameter("FixedFrequencyTable", {"Frequency": (916800,)}),),
                    ),
                    Parameter(
                        "C1G2UHFRFModeTable",
                        {},
                        (
                            Parameter(
                                "C1G2UHFRFModeTableEntry",
                                {
                                    "ModeIdentifier": 0,
                                    "Flags": 0,
                                    "MValue": 0,
                                    "ForwardLinkModulation": 0,
                                    "SpectralMaskIndicator": 0,
                                    "BDRValue": 40000,
                                    "PIEValue": 1500,
                                    "MinTariValue": 6250,
                                    "MaxTariValue": 25000,
                                    "StepTariValue": 0,
                                },
                            ),
                        ),
                    ),
                ),
            ),
        ),
    ),
    Parameter("C1G2LLRPCapabilities", {"Flags": 0, "MaxNumSelectFiltersPerQuery": 1}),
)
